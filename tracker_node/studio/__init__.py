"""The studio: a web server on this machine for posing, digitizing, playback and the live view.

Begin with `server`, then the page that you look for: `pose.page`, `digitize.page`, `playback.page`, `live.page`.
"""
