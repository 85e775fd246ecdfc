"""Reading regular files, and writing whole files or nothing."""
