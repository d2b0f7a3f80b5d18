"""The test report as a page, as JSON and for the terminal."""
