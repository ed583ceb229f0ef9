"""Smooth autonomous systems of the literature, each with its source; nothing here comes from saltus.

`PYTHONPATH=tests python tests/oracles/textbook_values.py` computes their special points independently, into
`textbook.json`.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Textbook:
    """A system, the parameter that varies, its interval, and a state near an equilibrium at a value of it."""

    name: str
    source: str
    parameters: dict[str, float]
    field: dict[str, str]
    parameter: str
    bounds: tuple[float, float]
    value: float
    start: tuple[float, ...]

    @property
    def states(self) -> tuple[str, ...]:
        return tuple(self.field)


_ALL: list[Textbook] = []


def _add(
    name: str,
    source: str,
    parameters: dict[str, float],
    field: dict[str, str],
    parameter: str,
    bounds: tuple[float, float],
    value: float,
    *start: float,
) -> None:
    _ALL.append(Textbook(name, source, parameters, field, parameter, bounds, value, start))


def _sigmoid(argument: str) -> str:
    return f"1/(1 + exp(-({argument})))"


_LORENZ = {"x": "s*(y - x)", "y": "x*(r - z) - y", "z": "x*y - b*z"}
_LORENZ_P = {"s": 10.0, "r": 24.0, "b": 8.0 / 3.0}
_LORENZ_SOURCE = "Lorenz, J. Atmos. Sci. 20 (1963) 130"
_add("Lorenz, origin", _LORENZ_SOURCE, _LORENZ_P, _LORENZ, "r", (0.2, 30.0), 0.5, 0.0, 0.0, 0.0)
_add("Lorenz, convection", _LORENZ_SOURCE, _LORENZ_P, _LORENZ, "r", (0.2, 30.0), 20.0, 7.0, 7.0, 19.0)
_add(
    "Roessler",
    "Roessler, Phys. Lett. A 57 (1976) 397",
    {"a": 0.2, "b": 0.3, "c": 5.7},
    {"x": "-y - z", "y": "x + a*y", "z": "b + z*(x - c)"},
    "c",
    (0.1, 8.0),
    5.7,
    0.0,
    0.0,
    0.03,
)
_add(
    "Roessler, a",
    "Kuznetsov, Elements, 2004, example 8.1 uses the family",
    {"a": 0.1, "b": 0.3, "c": 4.0},
    {"x": "-y - z", "y": "x + a*y", "z": "b*x - c*z + x*z"},
    "a",
    (-0.5, 0.9),
    0.1,
    0.0,
    0.0,
    0.0,
)
_add(
    "Brusselator",
    "Prigogine, Lefever, J. Chem. Phys. 48 (1968) 1695",
    {"A": 1.0, "B": 1.5},
    {"x": "A - (B + 1)*x + x**2*y", "y": "B*x - x**2*y"},
    "B",
    (1.0, 4.0),
    1.5,
    1.0,
    1.5,
)
_add(
    "FitzHugh-Nagumo",
    "FitzHugh, Biophys. J. 1 (1961) 445",
    {"a": 0.7, "b": 0.8, "e": 0.08, "I": 0.0},
    {"v": "v - v**3/3 - w + I", "w": "e*(v + a - b*w)"},
    "I",
    (-0.5, 2.0),
    0.0,
    -1.2,
    -0.6,
)
_ML = {
    "v": "(I - 2*(v + 60) - g*0.5*(1 + tanh((v + 1.2)/18))*(v - 120) - 8*w*(v + 84))/20",
    "w": "phi*(0.5*(1 + tanh((v - V3)/V4)) - w)*cosh((v - V3)/(2*V4))",
}
_RE = "Rinzel, Ermentrout, in Koch, Segev, Methods in Neuronal Modeling, MIT 1998, ch. 7, table 7.1"
_add(
    "Morris-Lecar, Hopf",
    _RE,
    {"g": 4.4, "V3": 2.0, "V4": 30.0, "phi": 0.04, "I": 10.0},
    _ML,
    "I",
    (0.0, 300.0),
    10.0,
    -50.0,
    0.03,
)
_add(
    "Morris-Lecar, SNIC",
    _RE,
    {"g": 4.0, "V3": 12.0, "V4": 17.4, "phi": 1.0 / 15.0, "I": 10.0},
    _ML,
    "I",
    (-50.0, 200.0),
    0.0,
    -60.0,
    0.0,
)
_add(
    "van der Pol",
    "van der Pol, Phil. Mag. 2 (1926) 978",
    {"m": -0.5},
    {"x": "y", "y": "m*(1 - x**2)*y - x"},
    "m",
    (-1.0, 1.0),
    -0.5,
    0.0,
    0.0,
)
_add(
    "Rayleigh",
    "Strutt, The Theory of Sound, 1883, sec. 68a",
    {"m": -0.5},
    {"x": "y", "y": "m*y - y**3/3 - x"},
    "m",
    (-1.0, 1.5),
    -0.5,
    0.0,
    0.0,
)
_add(
    "Rosenzweig-MacArthur",
    "Rosenzweig, MacArthur, Am. Nat. 97 (1963) 209",
    {"r": 1.0, "K": 1.0, "h": 1.0, "m": 0.4},
    {"x": "r*x*(1 - x/K) - x*y/(h + x)", "y": "x*y/(h + x) - m*y"},
    "K",
    (0.5, 4.0),
    1.0,
    0.6,
    0.5,
)
_add(
    "Bazykin",
    "Bazykin, Nonlinear Dynamics of Interacting Populations, 1998, sec. 3.5",
    {"a": 0.4, "e": 0.01, "g": 1.0, "d": 0.05},
    {"x": "x - x*y/(1 + a*x) - e*x**2", "y": "-g*y + x*y/(1 + a*x) - d*y**2"},
    "a",
    (0.05, 0.9),
    0.1,
    1.2,
    1.1,
)
_add(
    "Lotka-Volterra, limited",
    "Murray, Mathematical Biology I, 2002, sec. 3.3",
    {"r": 1.0, "K": 3.0, "a": 1.0, "m": 1.0},
    {"x": "x*(1 - x/K - a*y)", "y": "r*y*(x - m)"},
    "K",
    (0.4, 5.0),
    3.0,
    1.0,
    0.7,
)
_add(
    "competition",
    "Murray, Mathematical Biology I, 2002, sec. 3.5",
    {"a": 0.6, "b": 0.7, "r": 1.2},
    {"x": "x*(1 - x - a*y)", "y": "r*y*(1 - y - b*x)"},
    "a",
    (0.2, 1.3),
    0.6,
    0.7,
    0.5,
)
_add(
    "Holling-Tanner",
    "May, Stability and Complexity in Model Ecosystems, 1973, ch. 4",
    {"r": 1.0, "K": 7.0, "m": 6.0 / 7.0, "A": 1.0, "s": 0.3, "h": 0.8},
    {"x": "r*x*(1 - x/K) - m*x*y/(A + x)", "y": "s*y*(1 - h*y/x)"},
    "s",
    (0.01, 0.6),
    0.3,
    2.0,
    2.0,
)
_add(
    "Leslie-Gower, modified",
    "Aziz-Alaoui, Daher Okiye, Appl. Math. Lett. 16 (2003) 1069",
    {"s": 0.3, "k": 0.1, "h": 0.3},
    {"x": "x*(1 - x) - x*y/(x + h)", "y": "s*y*(1 - y/(x + k))"},
    "s",
    (0.01, 0.6),
    0.3,
    0.32,
    0.42,
)
_add(
    "Sel'kov",
    "Strogatz, Nonlinear Dynamics and Chaos, 1994, example 7.3.2",
    {"a": 0.08, "b": 0.2},
    {"x": "-x + a*y + x**2*y", "y": "b - a*y - x**2*y"},
    "b",
    (0.1, 1.2),
    0.2,
    0.2,
    1.6,
)
_add(
    "Schnakenberg",
    "Schnakenberg, J. Theor. Biol. 81 (1979) 389",
    {"a": 0.1, "b": 1.2},
    {"u": "a - u + u**2*v", "v": "b - u**2*v"},
    "b",
    (0.02, 1.5),
    1.2,
    1.3,
    0.7,
)
_add(
    "Oregonator",
    "Tyson, in Oscillations and Traveling Waves, Wiley 1985, ch. 3",
    {"e": 0.04, "q": 8e-4, "f": 1.0},
    {"x": "(x*(1 - x) - f*z*(x - q)/(x + q))/e", "z": "x - z"},
    "f",
    (0.3, 3.0),
    0.4,
    0.6,
    0.6,
)
_add(
    "Oregonator, three variables",
    "Field, Noyes, J. Chem. Phys. 60 (1974) 1877",
    {"e": 0.04, "d": 0.004, "q": 8e-4, "f": 1.0},
    {"x": "(q*y - x*y + x*(1 - x))/e", "y": "(-q*y - x*y + f*z)/d", "z": "x - z"},
    "f",
    (0.3, 3.0),
    0.4,
    0.6,
    0.4,
    0.6,
)
_CSTR = {"x": "-x + D*(1 - x)*exp(y)", "y": "-(1 + b)*y + B*D*(1 - x)*exp(y)"}
_URP = "Uppal, Ray, Poore, Chem. Eng. Sci. 29 (1974) 967"
_add("stirred tank, two Hopf points", _URP, {"B": 12.0, "b": 3.0, "D": 0.1}, _CSTR, "D", (0.05, 0.6), 0.1, 0.1, 0.2)
_add("stirred tank, hysteresis", _URP, {"B": 11.0, "b": 1.5, "D": 0.02}, _CSTR, "D", (0.02, 0.3), 0.03, 0.03, 0.1)
_add(
    "Goodwin",
    "Griffith, J. Theor. Biol. 20 (1968) 202",
    {"a": 1.0, "n": 10.0, "k": 0.3},
    {"x": "a/(1 + z**n) - k*x", "y": "x - k*y", "z": "y - k*z"},
    "k",
    (0.1, 1.5),
    1.2,
    0.6,
    0.5,
    0.4,
)
_add(
    "Lur'e feedback",
    "Kuznetsov, Elements, 2004, example 5.4",
    {"a": 2.0, "b": 1.0},
    {"x": "y", "y": "z", "z": "-a*z - b*y - x + x**2"},
    "a",
    (0.2, 3.0),
    2.0,
    0.0,
    0.0,
    0.0,
)
_add(
    "Chua, cubic",
    "Khibnik, Roose, Chua, Int. J. Bifurcation Chaos 3 (1993) 363",
    {"a": 3.0, "b": 14.0, "c": -1.0 / 7.0},
    {"x": "a*(y - 2*x**3/7 - c*x)", "y": "x - y + z", "z": "-b*y"},
    "a",
    (1.0, 10.0),
    3.0,
    0.7,
    0.0,
    -0.7,
)
_add(
    "Chua, cubic, origin",
    "Khibnik, Roose, Chua, Int. J. Bifurcation Chaos 3 (1993) 363",
    {"a": 1.0, "b": 2.0, "c": 0.3},
    {"x": "a*(y - x**3/6 - c*x)", "y": "x - y + z", "z": "-b*y"},
    "c",
    (-0.6, 0.8),
    0.5,
    0.0,
    0.0,
    0.0,
)
_add(
    "Rikitake",
    "Cook, Roberts, Proc. Camb. Phil. Soc. 68 (1970) 547",
    {"m": 1.0, "a": 2.0, "d": 0.05},
    {"x": "-m*x + z*y", "y": "-m*y + (z - a)*x", "z": "1 - x*y - d*z"},
    "d",
    (0.01, 1.5),
    0.2,
    1.3,
    0.7,
    2.0,
)
_add(
    "Chen",
    "Chen, Ueta, Int. J. Bifurcation Chaos 9 (1999) 1465",
    {"a": 35.0, "b": 3.0, "c": 20.0},
    {"x": "a*(y - x)", "y": "(c - a)*x - x*z + c*y", "z": "x*y - b*z"},
    "c",
    (15.0, 30.0),
    20.0,
    4.0,
    4.0,
    5.0,
)
_add(
    "Lue",
    "Lue, Chen, Int. J. Bifurcation Chaos 12 (2002) 659",
    {"a": 36.0, "b": 3.0, "c": 10.0},
    {"x": "a*(y - x)", "y": "-x*z + c*y", "z": "x*y - b*z"},
    "c",
    (5.0, 25.0),
    10.0,
    5.5,
    5.5,
    10.0,
)
_add(
    "Rabinovich-Fabrikant",
    "Rabinovich, Fabrikant, Sov. Phys. JETP 50 (1979) 311",
    {"a": 1.1, "g": 0.87},
    {"x": "y*(z - 1 + x**2) + g*x", "y": "x*(3*z + 1 - x**2) + g*y", "z": "-2*z*(a + x*y)"},
    "g",
    (-0.5, 1.0),
    0.5,
    0.0,
    0.0,
    0.0,
)
_add(
    "Sprott F",
    "Sprott, Phys. Rev. E 50 (1994) R647",
    {"a": -0.5},
    {"x": "y + z", "y": "-x + a*y", "z": "x**2 - z"},
    "a",
    (-1.0, 0.9),
    -0.5,
    0.0,
    0.0,
    0.0,
)
_add(
    "Sprott H",
    "Sprott, Phys. Rev. E 50 (1994) R647",
    {"a": -0.5},
    {"x": "-y + z**2", "y": "x + a*y", "z": "x - z"},
    "a",
    (-1.0, 0.9),
    -0.5,
    0.0,
    0.0,
    0.0,
)
_add(
    "Langford",
    "Langford, in Nonlinear Dynamics and Turbulence, Pitman 1983, 215",
    {"a": 0.95, "b": 0.7, "l": 0.2, "w": 3.5, "r": 0.25, "e": 0.1},
    {"x": "(z - b)*x - w*y", "y": "w*x + (z - b)*y", "z": "l + a*z - z**3/3 - (x**2 + y**2)*(1 + r*z) + e*z*x**3"},
    "l",
    (-1.5, 1.5),
    -1.2,
    0.0,
    0.0,
    -2.1,
)
_add(
    "Rucklidge",
    "Rucklidge, J. Fluid Mech. 237 (1992) 209",
    {"k": 2.0, "l": 5.0},
    {"x": "-k*x + l*y - y*z", "y": "x", "z": "-z + y**2"},
    "l",
    (-1.0, 8.0),
    2.0,
    0.0,
    1.4,
    2.0,
)
_add(
    "Shimizu-Morioka",
    "Shimizu, Morioka, Phys. Lett. A 76 (1980) 201",
    {"l": 2.0, "a": 0.4},
    {"x": "y", "y": "(1 - z)*x - l*y", "z": "-a*z + x**2"},
    "l",
    (0.3, 3.0),
    2.0,
    0.6,
    0.0,
    1.0,
)
_add(
    "Hindmarsh-Rose",
    "Hindmarsh, Rose, Proc. R. Soc. B 221 (1984) 87",
    {"I": 0.0, "r": 0.005, "s": 4.0},
    {"x": "y - x**3 + 3*x**2 - z + I", "y": "1 - 5*x**2 - y", "z": "r*(s*(x + 1.6) - z)"},
    "I",
    (0.0, 30.0),
    0.5,
    -1.5,
    -10.0,
    0.5,
)
_add(
    "Hindmarsh-Rose, fast",
    "Hindmarsh, Rose, Nature 296 (1982) 162",
    {"I": -5.0},
    {"x": "y - x**3 + 3*x**2 + I", "y": "1 - 5*x**2 - y"},
    "I",
    (-4.0, 15.0),
    -3.0,
    -2.3,
    -26.0,
)
_add(
    "Wilson-Cowan",
    "Hoppensteadt, Izhikevich, Weakly Connected Neural Networks, 1997, sec. 2.3",
    {"p": -4.0, "q": -4.0},
    {"x": f"-x + {_sigmoid('p + 10*x - 10*y')}", "y": f"-y + {_sigmoid('q + 10*x + 2*y')}"},
    "p",
    (-6.0, 4.0),
    -5.0,
    0.0,
    0.0,
)
_add(
    "toggle switch",
    "Gardner, Cantor, Collins, Nature 403 (2000) 339",
    {"a": 1.0, "b": 2.0},
    {"u": "a/(1 + v**2) - u", "v": "a/(1 + u**b) - v"},
    "a",
    (0.5, 4.0),
    1.0,
    0.7,
    0.7,
)
_add(
    "toggle switch, unequal",
    "Gardner, Cantor, Collins, Nature 403 (2000) 339",
    {"a": 1.0, "b": 3.0},
    {"u": "a/(1 + v**2) - u", "v": "b/(1 + u**2) - v"},
    "a",
    (0.5, 8.0),
    1.0,
    0.1,
    2.9,
)
_add(
    "repressilator",
    "Elowitz, Leibler, Nature 403 (2000) 335",
    {"a": 1.0, "n": 3.0},
    {"x": "a/(1 + z**n) - x", "y": "a/(1 + x**n) - y", "z": "a/(1 + y**n) - z"},
    "a",
    (0.5, 8.0),
    1.0,
    0.7,
    0.7,
    0.7,
)
_add(
    "Koper",
    "Koper, Physica D 80 (1995) 72",
    {"e": 0.1, "k": -10.0, "l": -12.0},
    {"x": "(k*y - x**3 + 3*x - l)/e", "y": "x - 2*y + z", "z": "y - z"},
    "l",
    (-16.0, 16.0),
    -14.0,
    1.3,
    1.3,
    1.3,
)
_add(
    "Maxwell-Bloch",
    "Haken, Phys. Lett. A 53 (1975) 77",
    {"k": 4.0, "g": 0.5, "l": 4.0},
    {"E": "k*(P - E)", "P": "E*D - P", "D": "g*(l + 1 - D - l*E*P)"},
    "l",
    (-0.8, 40.0),
    4.0,
    1.0,
    1.0,
    1.0,
)
_add(
    "laser with saturable absorber",
    "Erneux, Glorieux, Laser Dynamics, 2010, sec. 8.2",
    {"A": 3.0, "B": 2.0, "a": 4.0, "g": 0.2, "h": 0.3},
    {"I": "I*(-1 + x - y)", "x": "g*(A - x*(1 + I))", "y": "h*(B - y*(1 + a*I))"},
    "A",
    (0.5, 6.0),
    5.0,
    3.5,
    1.2,
    0.2,
)
_add(
    "pendulum with torque",
    "Strogatz, Nonlinear Dynamics and Chaos, 1994, sec. 8.5",
    {"T": 0.5, "c": 0.5},
    {"x": "y", "y": "T - sin(x) - c*y"},
    "T",
    (-0.5, 1.5),
    0.5,
    0.5,
    0.0,
)
_add(
    "buckled beam",
    "Golubitsky, Schaeffer, Singularities and Groups I, 1985, ch. 1",
    {"P": 0.5, "c": 0.3},
    {"x": "y", "y": "P*sin(x) - x - c*y"},
    "P",
    (0.3, 2.5),
    0.5,
    0.0,
    0.0,
)
_add(
    "Duffing-Holmes",
    "Holmes, Phil. Trans. R. Soc. A 292 (1979) 419",
    {"b": 1.0, "d": 0.2},
    {"x": "y", "y": "b*x - x**3 - d*y"},
    "b",
    (-1.0, 2.0),
    1.0,
    1.0,
    0.0,
)
_add(
    "Bonhoeffer-van der Pol",
    "Barnes, Grimshaw, J. Aust. Math. Soc. B 38 (1997) 427",
    {"a": 0.7, "b": 0.8, "c": 3.0, "z": 0.0},
    {"x": "c*(y + x - x**3/3 + z)", "y": "-(x - a + b*y)/c"},
    "z",
    (-2.0, 0.5),
    0.0,
    1.2,
    -0.6,
)
_add(
    "prey with Allee effect",
    "Wang, Shi, Wei, J. Math. Biol. 62 (2011) 291",
    {"a": 0.2, "m": 0.8},
    {"x": "x*(1 - x)*(x - a) - x*y", "y": "y*(x - m)"},
    "m",
    (0.25, 1.2),
    0.8,
    0.8,
    0.12,
)
_add(
    "SIRS, nonlinear incidence",
    "Liu, Levin, Iwasa, J. Math. Biol. 23 (1986) 187",
    {"k": 2.0, "A": 3.0, "d": 0.5, "v": 0.3, "m": 0.6},
    {"I": "k*I**2*(A - I - R) - (d + m)*I", "R": "m*I - (d + v)*R"},
    "A",
    (0.5, 4.0),
    3.0,
    1.5,
    1.1,
)
_add(
    "SEIR",
    "Anderson, May, Infectious Diseases of Humans, 1991, ch. 6",
    {"b": 2.0, "m": 0.1, "s": 0.8, "g": 0.5},
    {"S": "m - m*S - b*S*I", "E": "b*S*I - (m + s)*E", "I": "s*E - (m + g)*I"},
    "b",
    (0.2, 4.0),
    2.0,
    0.34,
    0.07,
    0.1,
)
_add(
    "chemostat",
    "Smith, Waltman, The Theory of the Chemostat, 1995, ch. 1",
    {"D": 0.3, "m": 1.0, "k": 0.5},
    {"S": "(1 - S)*D - m*S*x/(k + S)", "x": "x*(m*S/(k + S) - D)"},
    "D",
    (0.1, 0.9),
    0.3,
    0.2,
    0.8,
)
_add(
    "Gray-Scott",
    "Gray, Scott, Chem. Eng. Sci. 39 (1984) 1087",
    {"F": 0.02, "k": 0.05},
    {"u": "-u*v**2 + F*(1 - u)", "v": "u*v**2 - (F + k)*v"},
    "F",
    (0.003, 0.2),
    0.04,
    0.3,
    0.3,
)
_add(
    "Higgins",
    "Higgins, Proc. Natl. Acad. Sci. 51 (1964) 989",
    {"v": 0.5, "k": 1.0, "q": 0.08},
    {"x": "v - x*y**2 - q*x", "y": "x*y**2 + q*x - k*y/(1 + 0.1*y)"},
    "v",
    (0.05, 1.2),
    0.2,
    2.0,
    0.2,
)
_add(
    "autocatalator",
    "Merkin, Needham, Scott, SIAM J. Appl. Math. 47 (1987) 1040",
    {"m": 0.2, "r": 0.05},
    {"a": "m - a*b**2 - r*a", "b": "a*b**2 + r*a - b"},
    "m",
    (0.1, 1.2),
    0.15,
    2.0,
    0.15,
)
_add(
    "imperfect pitchfork",
    "Strogatz, Nonlinear Dynamics and Chaos, 1994, sec. 3.6",
    {"h": 0.1, "r": -0.5},
    {"x": "h + r*x - x**3"},
    "r",
    (-1.0, 2.0),
    1.0,
    -0.9,
)
_add(
    "cusp",
    "Kuznetsov, Elements, 2004, sec. 8.2",
    {"h": -1.0, "r": 1.0},
    {"x": "h + r*x - x**3"},
    "h",
    (-1.0, 1.0),
    -0.9,
    -1.3,
)
_add(
    "spruce budworm",
    "Ludwig, Jones, Holling, J. Anim. Ecol. 47 (1978) 315",
    {"r": 0.3, "k": 15.0},
    {"x": "r*x*(1 - x/k) - x**2/(1 + x**2)"},
    "r",
    (0.1, 1.0),
    0.3,
    0.5,
)
_add(
    "thermohaline circulation",
    "Cessi, J. Phys. Oceanogr. 24 (1994) 1911",
    {"F": 0.5, "m": 6.2**0.5},
    {"y": "F - y*(1 + m**2*(1 - y)**2)"},
    "F",
    (0.2, 2.0),
    0.5,
    0.1,
)
_add(
    "daisyworld",
    "Watson, Lovelock, Tellus B 35 (1983) 284, one species",
    {"L": 0.9, "g": 0.3},
    {"a": "a*((1 - a)*exp(-(T - 22.5)**2/150) - g)", "T": "0.1*(100*L*(0.5 + 0.25*a)**0.25 - 62 - T)"},
    "L",
    (0.6, 1.6),
    1.0,
    0.7,
    31.0,
)
_add(
    "Hopf normal form, rotated and shifted",
    "Kuznetsov, Elements, 2004, sec. 3.4",
    {"m": -0.5},
    {
        "x": "m*(x - 3) - 2*(y + 2) - (x - 3)*((x - 3)**2 + (y + 2)**2)",
        "y": "2*(x - 3) + m*(y + 2) - (y + 2)*((x - 3)**2 + (y + 2)**2)",
    },
    "m",
    (-1.0, 1.0),
    -0.5,
    3.0,
    -2.0,
)
_add(
    "Bautin normal form",
    "Kuznetsov, Elements, 2004, sec. 8.3",
    {"m": -0.5, "s": 0.7},
    {"x": "m*x - y + s*x*(x**2 + y**2) - x*(x**2 + y**2)**2", "y": "x + m*y + s*y*(x**2 + y**2) - y*(x**2 + y**2)**2"},
    "m",
    (-1.0, 1.0),
    -0.5,
    0.0,
    0.0,
)
_add(
    "Bogdanov-Takens normal form",
    "Kuznetsov, Elements, 2004, sec. 8.4",
    {"c": -1.0, "d": -0.5},
    {"x": "y", "y": "c + d*x + x**2 - x*y"},
    "c",
    (-1.0, 0.2),
    -0.9,
    -0.73,
    0.0,
)
_add(
    "double Hopf normal form",
    "Kuznetsov, Elements, 2004, sec. 8.6",
    {"m": -0.5},
    {
        "x": "m*x - y - x*(x**2 + y**2 + 0.5*u**2 + 0.5*v**2)",
        "y": "x + m*y - y*(x**2 + y**2 + 0.5*u**2 + 0.5*v**2)",
        "u": "(m - 0.2)*u - 2.3*v + u*(u**2 + v**2)",
        "v": "2.3*u + (m - 0.2)*v + v*(u**2 + v**2)",
    },
    "m",
    (-1.0, 1.0),
    -0.5,
    0.0,
    0.0,
    0.0,
    0.0,
)
_add(
    "transcritical, rotated",
    "Guckenheimer, Holmes, Nonlinear Oscillations, 1983, sec. 3.4",
    {"m": -0.5},
    {
        "x": "0.5*(m*(x + y) - (x + y)**2) - (x - y) + 0.25*z*(x + y)",
        "y": "0.5*(m*(x + y) - (x + y)**2) + (x - y)",
        "z": "-2*z + (x + y)**2",
    },
    "m",
    (-1.0, 1.0),
    -0.5,
    0.0,
    0.0,
    0.0,
)
_A, _B = "v + 40", "v + 65"
_add(
    "Hodgkin-Huxley",
    "Hodgkin, Huxley, J. Physiol. 117 (1952) 500",
    {"I": 0.0},
    {
        "v": "I - 120*m**3*h*(v - 50) - 36*n**4*(v + 77) - 0.3*(v + 54.4)",
        "m": f"0.1*({_A})/(1 - exp(-({_A})/10))*(1 - m) - 4*exp(-({_B})/18)*m",
        "h": f"0.07*exp(-({_B})/20)*(1 - h) - h/(1 + exp(-(v + 35)/10))",
        "n": f"0.01*(v + 55)/(1 - exp(-(v + 55)/10))*(1 - n) - 0.125*exp(-({_B})/80)*n",
    },
    "I",
    (0.0, 200.0),
    0.0,
    -65.0,
    0.05,
    0.6,
    0.32,
)
_add(
    "Genesio-Tesi",
    "Genesio, Tesi, Automatica 28 (1992) 531",
    {"a": 1.2, "b": 2.92, "c": 6.0},
    {"x": "y", "y": "z", "z": "-c*x - b*y - a*z + x**2"},
    "c",
    (-1.0, 6.0),
    2.0,
    0.0,
    0.0,
    0.0,
)
_add(
    "Moore-Spiegel",
    "Moore, Spiegel, Astrophys. J. 143 (1966) 871",
    {"T": 6.0, "R": 2.0},
    {"x": "y", "y": "z", "z": "-z - (T - R + R*x**2)*y - T*x"},
    "R",
    (-1.0, 3.0),
    -0.5,
    0.0,
    0.0,
    0.0,
)
_add(
    "Lorenz-84",
    "Shilnikov, Nicolis, Nicolis, Int. J. Bifurcation Chaos 5 (1995) 1701",
    {"a": 0.25, "b": 4.0, "F": 1.0, "G": 0.25},
    {"x": "-y**2 - z**2 - a*x + a*F", "y": "x*y - b*x*z - y + G", "z": "b*x*y + x*z - z"},
    "F",
    (0.2, 4.0),
    0.5,
    0.4,
    0.1,
    0.2,
)
_add(
    "food chain",
    "Hastings, Powell, Ecology 72 (1991) 896",
    {"b": 2.0},
    {
        "x": "x*(1 - x) - 5*x*y/(1 + b*x)",
        "y": "5*x*y/(1 + b*x) - 0.1*y*z/(1 + 2*y) - 0.4*y",
        "z": "0.1*y*z/(1 + 2*y) - 0.01*z",
    },
    "b",
    (1.5, 3.5),
    2.0,
    0.7,
    0.125,
    10.0,
)
_add(
    "Watt governor",
    "Pontryagin, Ordinary Differential Equations, 1962, sec. 27",
    {"e": 1.5, "w": 0.7, "m": 0.5},
    {"x": "y", "y": "z**2*sin(x)*cos(x) - sin(x) - e*y", "z": "m*(cos(x) - w)"},
    "e",
    (0.2, 2.0),
    1.5,
    0.8,
    0.0,
    1.2,
)
_add(
    "Colpitts oscillator",
    "Maggio, De Feo, Kennedy, IEEE Trans. Circuits Syst. I 46 (1999) 1118",
    {"g": 0.5, "Q": 1.4, "k": 0.5},
    {"x": "g/(Q*(1 - k))*(-exp(-y) + 1 + z)", "y": "g/(Q*k)*z", "z": "-Q*k*(1 - k)/g*(x + y) - z/Q"},
    "g",
    (0.3, 3.0),
    0.5,
    0.0,
    0.0,
    0.0,
)
_add(
    "Thomas, cyclically symmetric",
    "Thomas, Int. J. Bifurcation Chaos 9 (1999) 1889",
    {"b": 0.5},
    {"x": "sin(y) - b*x", "y": "sin(z) - b*y", "z": "sin(x) - b*z"},
    "b",
    (0.25, 1.5),
    0.5,
    1.9,
    1.9,
    1.9,
)
_add(
    "Lorenz-Stenflo",
    "Stenflo, Phys. Scripta 53 (1996) 83",
    {"s": 1.0, "r": 10.0, "b": 0.7, "k": 1.5},
    {"x": "s*(y - x) + k*w", "y": "r*x - x*z - y", "z": "x*y - b*z", "w": "-x - s*w"},
    "r",
    (1.0, 60.0),
    10.0,
    1.0,
    2.6,
    4.0,
    -1.0,
)
_add(
    "hyper-Roessler",
    "Roessler, Phys. Lett. A 71 (1979) 155",
    {"a": 0.25, "b": 3.0, "c": 0.5, "d": 0.05},
    {"x": "-y - z", "y": "x + a*y + w", "z": "b + x*z", "w": "-c*z + d*w"},
    "a",
    (0.05, 0.6),
    0.25,
    -5.4,
    -0.55,
    0.55,
    5.5,
)
_add(
    "two coupled Brusselators",
    "Schreiber, Marek, Physica D 5 (1982) 258",
    {"A": 2.0, "B": 4.0, "D": 0.2},
    {
        "x": "A - (B + 1)*x + x**2*y + D*(u - x)",
        "y": "B*x - x**2*y + 4*D*(v - y)",
        "u": "A - (B + 1)*u + u**2*v + D*(x - u)",
        "v": "B*u - u**2*v + 4*D*(y - v)",
    },
    "B",
    (2.0, 7.0),
    3.0,
    2.0,
    1.5,
    2.0,
    1.5,
)
_add(
    "cell cycle",
    "Tyson, Proc. Natl. Acad. Sci. 88 (1991) 7328",
    {"k1": 0.015, "k4": 180.0, "q": 1e-4, "k6": 1.0},
    {"u": "k4*(w - u)*(q + u**2) - k6*u", "w": "k1 - k6*u"},
    "k6",
    (0.15, 4.0),
    0.5,
    0.03,
    0.1,
)
_add(
    "activator-inhibitor",
    "Gierer, Meinhardt, Kybernetik 12 (1972) 30",
    {"c": 1.5, "r": 0.05},
    {"a": "r + a**2/h - a", "h": "c*(a**2 - h)"},
    "c",
    (0.3, 2.0),
    1.5,
    1.05,
    1.1,
)

TEXTBOOK: dict[str, Textbook] = {item.name: item for item in _ALL}
