"""What tests share: small bodies, cameras, recordings, servers, graphs. Tests themselves stand beside what they test."""
