"""Fits the hands of children in handmodels/anthropometry.yaml (block `children`) and reports their errors.

    python3 tests/hand/fit_children.py children_hands.csv            RMSE and bias by age band, five-fold cross-validation
    python3 tests/hand/fit_children.py tests/data/oracles/children_hands.csv    the same with every fifth child alone
    python3 tests/hand/fit_children.py children_hands.csv --yaml     the coefficients, for handmodels/anthropometry.yaml

The CSV has a row per child: sex (m, f), age_months, stature_mm, mass_hg (0.1 kg), hand_length_mm, hand_breadth_mm,
thumb_length_mm, index_length_mm, middle_length_mm. Model, for each sex: ln y = a(x) + b(x) ln H + c(x) ln m, where a, b and c
are linear between knots of x, age or stature, and constant beyond them. Weighted least squares with Huber weights, and small
penalties on differences between neighbouring knots. Unknown sex: the mean of both, weighted with the chances of each sex at this
stature and age, of normal ln H about the medians of the sexes. Fingers: ln (finger / hand length) = a(x), of both sexes; a
measured hand length of exp(d) times its prediction changes a finger by exp(finger_of_length d).
"""
import argparse
import csv
import pathlib
import re

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
MODEL = HERE.parents[1] / "handmodels/anthropometry.yaml"
AGES = [2.5, 4, 6, 8, 10, 12, 14, 16, 18]
STATURES = [0.9, 1.05, 1.2, 1.35, 1.5, 1.65, 1.8]
ADULT_AGE = (18, 20)  # a child's fit below, the adults' above
STATURE_DEVIATION = 0.0435  # of ln H at one age and sex, by the residuals
ADULT_STATURE, ADULT_MASS_PER_STATURE = (1.25, 1.45), (28, 33.5)  # the same, for persons of unknown age [m, kg/m]
FINGERS = ("thumb", "index", "middle")


def children(path):
    rows = list(csv.DictReader(line for line in open(path) if not line.startswith("#")))
    short = {"age_months": "age", "stature_mm": "stature", "mass_hg": "mass"}  # names in tests/data/oracles/children_hands.csv

    def column(key):
        name = key if key in rows[0] else short.get(key, key.removesuffix("_mm").removeprefix("hand_").removesuffix("_length"))
        return np.array([float(r[name]) if r[name].strip() not in ("", "0") else np.nan for r in rows])

    c = {"female": np.array([r["sex"] == "f" for r in rows]), "age": column("age_months") / 12,
         "stature": column("stature_mm") / 1000, "mass": column("mass_hg") / 10,
         "hand_length": column("hand_length_mm") / 1000, "hand_breadth": column("hand_breadth_mm") / 1000}
    c |= {f: column(f"{f}_length_mm") / 1000 for f in FINGERS}
    # Wrong records are those of which a share of stature is more than 5 robust deviations from the median.
    for key in ("hand_length", "hand_breadth", *FINGERS):
        share = c[key] / c["stature"]
        middle = np.nanmedian(share)
        c[key][np.abs(share - middle) > 5 * 1.4826 * np.nanmedian(np.abs(share - middle))] = np.nan
    whole = np.isfinite(c["age"] * c["stature"] * c["mass"])
    return {key: values[whole] for key, values in c.items()}


def hats(x, knots):
    """Weights of the knots at x, n x k: linear between knots, constant beyond them."""
    x = np.clip(x, knots[0], knots[-1])
    return np.array([np.interp(x, knots, unit) for unit in np.eye(len(knots))]).T


def smoothstep(x, low, high):
    t = np.clip((x - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def robust(design, y, penalty, rounds=10):
    """Least squares with Huber weights (1.5 robust deviations), and penalised rows."""
    weight = np.ones(len(y))
    for _ in range(rounds):
        w = np.sqrt(weight)
        b = np.linalg.lstsq(np.vstack([design * w[:, None], penalty]), np.r_[y * w, np.zeros(len(penalty))], rcond=None)[0]
        off = np.abs(y - design @ b)
        scale = 1.4826 * np.median(off)
        weight = np.minimum(1, 2.5 * scale / np.maximum(off, 1e-12))
    return b


def fit(c, y, x, knots, smooth=3.0):
    """Rows intercept, stature, mass; a column per knot."""
    h = hats(c[x], knots)
    design = np.hstack([h, h * np.log(c["stature"])[:, None], h * np.log(c["mass"])[:, None]])
    differences = np.diff(np.eye(len(knots)), axis=0) * smooth
    zero = np.zeros_like(differences)
    ridge = np.block([[zero, differences, zero], [zero, zero, differences]])
    if x == "stature":  # b ln H has the trend, a(x) what is left of it
        ridge = np.vstack([ridge, np.hstack([differences, zero, zero]) / smooth])
    return robust(design, np.log(y), ridge).reshape(3, -1)


def predict(coefficients, c, x, knots):
    a, b, m = (hats(c[x], knots) @ row for row in coefficients)
    return a + b * np.log(c["stature"]) + m * np.log(c["mass"])


def subset(c, of):
    return {key: values[of] for key, values in c.items()}


KINDS = {"by_age": ("age", AGES), "by_stature": ("stature", STATURES)}


def fit_all(c):
    out = {}
    for kind, (x, knots) in KINDS.items():
        for sex in (False, True):
            for y in ("hand_length", "hand_breadth"):
                of = subset(c, (c["female"] == sex) & np.isfinite(c[y]))
                out[kind, sex, y] = fit(of, of[y], x, knots)
            of = subset(c, c["female"] == sex)
            out[kind, sex, "stature"] = robust(hats(of[x], knots), np.log(of["stature"]), np.zeros((0, len(knots))))
        for finger in FINGERS:
            of = subset(c, np.isfinite(c[finger] * c["hand_length"]))
            d = np.diff(np.eye(len(knots)), 2, axis=0) * 10
            out[kind, finger] = robust(hats(of[x], knots), np.log(of[finger] / of["hand_length"]), d)
    return out


def adults():
    """Coefficients of the adults' fits: [by sex or pooled][dimension] -> intercept, stature, mass, female, smearing."""
    text = MODEL.read_text()
    out = {}
    for fit_name in ("by_sex", "pooled"):
        part = text[text.index(f"\n  {fit_name}:"):]
        for y in ("hand_length", "hand_breadth"):
            row = re.search(rf"\n    {y}: {{(.*?)}}", part).group(1)
            out[fit_name, y] = {k: float(v) for k, v in (item.split(": ") for item in row.split(", "))}
    return out


def adult_share(c, with_age):
    if with_age:
        return smoothstep(c["age"], *ADULT_AGE)
    return smoothstep(c["stature"], *ADULT_STATURE) * smoothstep(c["mass"] / c["stature"], *ADULT_MASS_PER_STATURE)


def hand(fits, grown, c, y, with_age, with_sex):
    """Predictions [m] as src/handsim/hand/anthropometry.cpp makes them."""
    kind = "by_age" if with_age else "by_stature"
    x, knots = KINDS[kind]
    male, female = (predict(fits[kind, sex, y], c, x, knots) for sex in (False, True))
    a = grown["by_sex" if with_sex else "pooled", y]
    adult = a["intercept"] + a["stature"] * np.log(c["stature"]) + a["mass"] * np.log(c["mass"])
    if with_sex:
        adult = adult + a["female"] * c["female"]
    girl = 0.5
    if with_age:
        off = [(np.log(c["stature"]) - hats(c[x], knots) @ fits[kind, sex, "stature"]) / STATURE_DEVIATION for sex in (False, True)]
        girl = 1 / (1 + np.exp(0.5 * (off[1] ** 2 - off[0] ** 2)))
    child = np.where(c["female"], female, male) if with_sex else girl * female + (1 - girl) * male
    share = adult_share(c, with_age)
    return a["smearing"] * np.exp(share * adult + (1 - share) * child)


def cross_validated(c, folds=5):
    fold = np.random.default_rng(1).integers(0, folds, len(c["age"]))
    grown = adults()
    out = {}
    for k in range(folds):
        fits = fit_all(subset(c, fold != k))
        here = fold == k
        part = subset(c, here)
        for with_age in (True, False):
            for with_sex in (True, False):
                for y in ("hand_length", "hand_breadth"):
                    out.setdefault((y, with_age, with_sex), np.empty(len(fold)))[here] = hand(fits, grown, part, y, with_age, with_sex)
                if with_sex:
                    kind = "by_age" if with_age else "by_stature"
                    x, knots = KINDS[kind]
                    share = adult_share(part, with_age)
                    for f in FINGERS:
                        a = hats(part[x], knots) @ fits[kind, f]
                        grown_up = fits["by_age", f][-1]
                        out.setdefault((f, with_age, True), np.empty(len(fold)))[here] = out["hand_length", with_age, True][here] * np.exp(
                            share * grown_up + (1 - share) * a)
                        out.setdefault((f, with_age, "measured"), np.empty(len(fold)))[here] = part["hand_length"] * np.exp(
                            share * grown_up + (1 - share) * a)
    # The floor of the data: a free quadratic regression on stature, mass, age and sex of each finger.
    for f in FINGERS:
        s, m, a, g = np.log(c["stature"]), np.log(c["mass"]), c["age"] / 10, c["female"] * 1.0
        cols = [np.ones_like(s), s, m, a]
        design = np.array([u * v for i, u in enumerate(cols) for v in cols[i:]] + [g * u for u in cols]).T
        values = np.full(len(s), np.nan)
        ok = np.isfinite(c[f])
        for k in range(folds):
            train = ok & (fold != k)
            b = np.linalg.lstsq(design[train], np.log(c[f][train]), rcond=None)[0]
            values[fold == k] = np.exp(design[fold == k] @ b)
        out[f, "floor", True] = values
    return out


def report(c):
    """Tables of errors [mm] in the form of docs/persons.md: RMSE, bias of boys and of girls by age band."""
    values = cross_validated(c)
    bands = [(low, low + 2) for low in range(2, 20, 2)] + [(0, 99)]

    def cells(y, with_age, with_sex, band):
        e = 1000 * (values[y, with_age, with_sex] - c[y])
        of = np.isfinite(e) & (c["age"] >= band[0]) & (c["age"] < band[1])
        rmse = np.sqrt(np.mean(e[of] ** 2))
        if with_sex is False:
            return f"{rmse:.1f}, {e[of].mean():+.1f}"
        return f"{rmse:.1f}, " + " ".join(f"{e[of & (c['female'] == girl)].mean():+.1f}" for girl in (False, True))

    for y in ("hand_length", "hand_breadth"):
        print(f"| {y.replace('_', ' ')}, age | n | age and sex | age | sex | neither |\n| --- | --- | --- | --- | --- | --- |")
        for band in bands:
            n = np.sum(np.isfinite(c[y]) & (c["age"] >= band[0]) & (c["age"] < band[1]))
            name = "all" if band[0] == 0 else f"{band[0]}–{band[1]}"
            print(f"| {name} | {n} | " + " | ".join(cells(y, a, s, band) for a, s in ((True, True), (True, False), (False, True), (False, False))) + " |")
        print()
    print("| finger | n | age and sex | sex | hand length measured | floor |\n| --- | --- | --- | --- | --- | --- |")
    for f in FINGERS:
        print(f"| {f} | {np.sum(np.isfinite(c[f]))} | " + " | ".join(
            cells(f, a, s, bands[-1]) for a, s in ((True, True), (False, True), (True, "measured"), ("floor", True))) + " |")


def yaml(c):
    fits = fit_all(c)
    for kind, (x, knots) in KINDS.items():
        print(f"  {kind}:")
        for sex, name in ((False, "male"), (True, "female")):
            print(f"    {name}:")
            medians = np.exp(fits[kind, sex, "stature"]) if x == "age" else knots
            for k, knot in enumerate(knots):
                row = [v for y in ("hand_length", "hand_breadth") for v in fits[kind, sex, y][:, k]] + [fits[kind, f][k] for f in FINGERS]
                print("      - [" + ", ".join([f"{knot:g}"] + [f"{v:.5f}" for v in row] + [f"{medians[k]:.4g}"]) + "]")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("csv")
    parser.add_argument("--yaml", action="store_true")
    arguments = parser.parse_args()
    (yaml if arguments.yaml else report)(children(arguments.csv))
