"""What a person types, one module a command: files in, files out, words."""
