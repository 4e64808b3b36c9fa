"""The studio: a scene is edited on a page in the browser, and every edit is solved at once."""
