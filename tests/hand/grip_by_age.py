"""Norms of grip strength by age beside another survey: table in Markdown, and a plot.

grip_by_age.py SURVEY.csv [PLOT.png]: SURVEY is table 2 of Tomkinson et al. 2025 (J Sport Health Sci 14:101014, 2.4 million adults of 69 countries)
with columns sex, age_band, p5_N, p50_N, p95_N. Ours are the norms of handmodels/grip_strength.yaml at one stature for each sex; children have
the median stature of their age.
"""
import csv
import re
import subprocess
import sys
from pathlib import Path

ROW = re.compile(r"\{sex: (male|female), age: \[([\d.]+), ([\d.]+)\], stature: \[([\d.]+), ([\d.]+)\], mean: ([\d.]+), deviation: ([\d.]+)\}")
NORMS = Path(__file__).parents[2] / "handmodels/grip_strength.yaml"
STATURE = {"male": 1.76, "female": 1.63}  # of the adults [m]


def ours():
    """[(sex, from, to, mean, deviation)] in the order of the file, at the stature of the sex."""
    rows = [(sex, *map(float, rest)) for sex, *rest in ROW.findall(NORMS.read_text())]
    assert rows, f"no norms in {NORMS}"
    return [(sex, low, high, mean, sd) for sex, low, high, least, most, mean, sd in rows
            if high <= 16 or least <= STATURE[sex] < most]


def main():
    norms = ours()
    survey = []
    for line in csv.DictReader(row for row in open(sys.argv[1]) if not row.startswith("#")):
        low = float(re.match(r"\d+", line["age_band"])[0])
        survey.append(({"M": "male", "F": "female"}[line["sex"]], low, *(float(line[f"p{p}_N"]) for p in (5, 50, 95))))
    print("| age | men: ours | survey | women: ours | survey |\n| --- | --- | --- | --- | --- |")
    worst = {}
    for age in sorted({row[1] for row in survey}):
        cells = []
        for sex in ("male", "female"):
            own = next(((mean, sd) for of, low, high, mean, sd in norms if of == sex and low <= age + 2 <= high), None)
            other = next((row[2:] for row in survey if row[0] == sex and row[1] == age), None)
            cells += [f"{own[0]:.0f} ± {own[1]:.0f}" if own else "-", f"{other[1]:.0f} ({other[0]:.0f} to {other[2]:.0f})" if other else "-"]
            if own and other:
                worst[sex] = max(worst.get(sex, (0, 0)), (abs(own[0] / other[1] - 1), age))
        print(f"| {age:.0f} | " + " | ".join(cells) + " |")
    for sex, (share, age) in worst.items():
        print(f"\nlargest difference from the survey's median, {sex}: {100 * share:.0f} % at {age:.0f} years")
    if len(sys.argv) > 2:
        plot(norms, survey, sys.argv[2])


def plot(norms, survey, file):
    blocks, parts = [], []
    for sex, colour in (("male", "#0072b2"), ("female", "#d55e00")):
        name = "men, boys" if sex == "male" else "women, girls"
        blocks += [f"${sex} << EOD\n" + "".join(f"{0.5 * (low + high)} {mean} {sd}\n" for of, low, high, mean, sd in norms if of == sex) + "EOD"]
        blocks += [f"${sex}_survey << EOD\n" + "".join(f"{low + 2} {p5} {p50} {p95}\n" for of, low, p5, p50, p95 in survey if of == sex) + "EOD"]
        parts += [f"${sex}_survey using 1:2:4 with filledcurves fc rgb '{colour}' fs transparent solid 0.12 notitle",
                  f"${sex}_survey using 1:3 with lines dt 2 lw 2 lc rgb '{colour}' title '{name}, survey: median, 5 to 95 %'",
                  f"${sex} using 1:2:3 with yerrorlines pt 7 ps 0.8 lw 1.6 lc rgb '{colour}' title '{name}, norms: mean and standard deviation'"]
    script = "\n".join([*blocks, f"set terminal pngcairo size 900,520 font 'DejaVu Sans,10'\nset output '{file}'",
                        "set xlabel 'age [years]'\nset ylabel 'grip strength [N]'\nset grid lc rgb '#d8dce1'\nset key top right\nset yrange [0:820]\nset xrange [0:102]",
                        "plot " + ", \\\n  ".join(parts)])
    subprocess.run(["gnuplot"], input=script, text=True, check=True)


if __name__ == "__main__":
    main()
