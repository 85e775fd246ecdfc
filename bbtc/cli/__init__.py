"""The command line: arguments, files, exit statuses."""
