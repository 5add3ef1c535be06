"""Print every ```bash block of the given Markdown files: what a reader is told to type, CI runs."""

from __future__ import annotations

import re
import sys
from pathlib import Path

for name in sys.argv[1:]:
    for block in re.findall(r"^```bash\n(.*?)^```", Path(name).read_text(), re.M | re.S):
        print(block, end="")
