"""Which of the poses that fit alike: symmetries of the part, the choice, and the words where several remain."""
