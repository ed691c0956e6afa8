"""Measurements, side by side with their floor or peer in the same run: `python -m bench`."""
