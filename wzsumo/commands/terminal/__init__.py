"""What all commands share: types of arguments, progress, figures in words, completion."""
