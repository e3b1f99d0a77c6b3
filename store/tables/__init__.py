"""Every table under its name, and what all of them are made of."""

from store.tables.audit import *
from store.tables.base import *
from store.tables.calibration import *
from store.tables.campaign import *
from store.tables.job import *
from store.tables.organisation import *
