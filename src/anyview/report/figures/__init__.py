"""Figures 13 to 20 and their companions, split by subject. Each function returns one matplotlib figure."""
