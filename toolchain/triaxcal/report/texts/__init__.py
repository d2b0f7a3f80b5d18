"""The texts of the pages in every language: a file each in templates/languages."""
