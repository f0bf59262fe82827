"""The interactive page: `softstart serve`. NiceGUI is imported only when the page is built."""

USER = "softstart.user"  # in the scope of a request: whose browser it comes from
