import sys
from pathlib import Path

# The makers beside these tests are theirs alone and no package.
sys.path.insert(0, str(Path(__file__).parent))
