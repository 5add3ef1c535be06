"""Readers and writers of files, in folders by what these hold.

`recording` builds on `video`, and that on `cameras`; `subject` on `cameras`; `motion` on none. What lies beside them
all of them may use.
"""
