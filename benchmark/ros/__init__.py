"""The graph: ingest, transport, live tracking, recording, starting, stopping."""
