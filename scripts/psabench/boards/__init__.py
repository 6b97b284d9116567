"""The boards: what all have in common here, and a folder for each."""
