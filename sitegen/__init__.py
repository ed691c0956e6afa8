"""Predictions and truth to scores, a leaderboard and a static site."""
