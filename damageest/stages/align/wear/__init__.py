"""What unworn skin tells: the pose by the outermost skin, and motions that it leaves free."""

# check_worn.py: checks whether a pose explains a scan of a part that is worn over much of its skin
# datum_skin.py: the skin of a part that its datum consists of
# explained.py: how well errors of a size and wear explain the distances of patches together
# finish.py: the last fit of a pose
# free.py: motions along which unworn skin does not fix the pose
# one_sided.py: the pose by the outermost surface
# skin_patches.py: patches of the scanned skin
# words.py: motions of the scan as shifts and turns of the part's frame, and as text
