"""Drive profiles: what is known of a family of drives, each fact with its source.

Their format: docs/how-to/add-a-drive.md. `model` is the file, `library` finds the one of a drive,
`fill` lets it fill what a machine file leaves open, `writing` renders one that was learned.
"""

from stagectl.config.profiles.fill import Filled as Filled
from stagectl.config.profiles.fill import fill as fill
from stagectl.config.profiles.fill import with_profile as with_profile
from stagectl.config.profiles.library import families as families
from stagectl.config.profiles.library import load_profile as load_profile
from stagectl.config.profiles.library import parse_profile as parse_profile
from stagectl.config.profiles.library import profile_of as profile_of
from stagectl.config.profiles.model import Fact as Fact
from stagectl.config.profiles.model import Profile as Profile
from stagectl.config.profiles.writing import family_of as family_of
from stagectl.config.profiles.writing import render_profile as render_profile
