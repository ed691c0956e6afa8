"""Dashcam videos to hazard predictions: the multi-agent pipeline of arXiv 2504.13399."""

__version__ = "0.1.0"
