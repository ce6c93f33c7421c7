"""The studio as people use it: a server and a browser."""
