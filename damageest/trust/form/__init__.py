"""Forms of the whole part: bend, twist, shear, stretch, scale."""

# form_fields.py: their displacement fields
# form_fit.py: their fit to intact skin
# form_choice.py: which of them the scan shows
# form_words.py: the same in words
