"""The interactive page: `softstart serve`. NiceGUI is imported only when the page is built."""

USER = "user"  # in the session of a request: whose browser it comes from
