"""Synthetic motion with known loads. The truth shares no code with the estimators it judges."""
