"""The linear view of a running controller: its loop in contact, margins, limit cycles; see `view`."""
