"""What a session leaves for people: one self-contained HTML page with figures."""
