"""What the screens show and do, as values: no Qt in here."""
