"""Calls under way: starts, directions, events, and what goes on behind them."""
