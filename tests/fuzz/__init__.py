"""Fuzzing: damaged files and odd command lines, each checked against the promise (see `promise.py`)."""
