"""What instruments on a body in flight read: rows on its states, noise, bias and clock."""
