"""The interactive page: `softstart serve`. NiceGUI is imported only when the page is built."""
