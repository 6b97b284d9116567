"""TOY, the board of docs/new_board.md."""
