"""Version of the package; setup.py and the manifests say the same."""

__version__ = "0.2.0"
