"""What a person starts: scenes, the command line, batches, the studio, pages to review."""
