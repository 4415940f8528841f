"""What unworn skin tells: the pose by the outermost skin, and motions that it leaves free."""
