"""One page to review a run: it reads what the run has written."""
