"""Worlds that change while a body is tracked. Each program is run by itself; see docs/development.md."""
