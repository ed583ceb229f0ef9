"""How equality is judged: errors of one solution, verdicts that may be *cannot tell*, and the numbers that judge.

This package is the only place with numbers that judge whether two quantities are the same, whether a motion rests,
whether a value is 0. Each stands once, with its reason, in the module of its kind; all are names of this package.
"""

from saltus.scales.alike import *
from saltus.scales.branches import *
from saltus.scales.converged import *
from saltus.scales.doubles import *
from saltus.scales.flows import *
from saltus.scales.judgement import *
from saltus.scales.multipliers import *
from saltus.scales.parameters import *
from saltus.scales.quantities import *
from saltus.scales.singular import *
from saltus.scales.states import *
from saltus.scales.surfaces import *
from saltus.scales.verified import *
