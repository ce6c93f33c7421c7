"""Small bodies, and motions and pictures of them."""
