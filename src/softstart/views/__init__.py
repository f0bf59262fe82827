"""What is shown of each kind of result: headline, notes, columns, rows and figures, each written once."""
