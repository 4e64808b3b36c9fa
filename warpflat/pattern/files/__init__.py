"""What is written: files whole or not at all, what is left out of them, their date, and work on another core that writes them."""
