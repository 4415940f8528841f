"""Who decides the pose of a datum: single datums, datum systems (ISO 5459), and the fits that end with them."""
