"""Launching kernels, errors, files and text: what every other room uses, and what knows no mesh."""
