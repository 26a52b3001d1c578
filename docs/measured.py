"""Makes the measured tables as Markdown from the files of studies in out/docs/: one function for each table."""
import csv
import json
import math
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
OUT = ROOT / "out" / "docs"
CLIMBS = {"half_crimp": "half crimp, edge of 20 mm", "open_hand": "open hand, edge of 20 mm, three fingers",
          "jug": "jug"}
PERSONS = {"child": (1.10, 18), "adult": (1.75, 72), "giant": (2.10, 140)}
CONTROLLERS = {"implicit": (1, 5, 10, 20), "integral": (1, 5, 10, 20), "explicit": (1,)}


# Reading the files of studies.

class Missing(Exception):
    """A file of a study does not exist."""


def study_text(study, label, ending="txt"):
    path = OUT / study / f"{label}.{ending}"
    if not path.exists():
        raise Missing(f"{path.relative_to(ROOT)}")
    return path.read_text()


def study_json(study, label, name):
    path = OUT / study / label / name
    if not path.exists():
        raise Missing(f"{path.relative_to(ROOT)}")
    return json.loads(path.read_text())


# Formatting of numbers and tables.

def number(value, digits=2):
    """1.2e-5, 0.012, 120: `digits` significant digits, or all digits before the decimal point."""
    if value is None:
        return "-"
    if value == 0 or not math.isfinite(value):
        return f"{value:g}"
    size = math.floor(math.log10(abs(value)))
    if -3 <= size < 5:
        return f"{value:.{max(digits - 1 - size, 0)}f}"
    return re.sub(r"e([-+])0", r"e\1", f"{value:.{digits - 1}e}").replace("e+", "e")


def slashed(values, digits=2):
    return " / ".join(number(value, digits) for value in values)


def table(head, rows):
    lines = [head, ["---"] * len(head), *rows]
    return "".join("| " + " | ".join(str(cell) for cell in line) + " |\n" for line in lines)


def fenced(text):
    return "```\n" + "\n".join(line.rstrip() for line in text.rstrip().splitlines()) + "\n```\n"


def measured_on(data):
    return f"\nMeasured on: {data['machine']['processor']}.\n"


def criterion(summary, name):
    return next(entry["measured"] for entry in summary["criteria"] if entry["name"] == name)


# The tables, by name.

def demo():
    # Without the last line, which has the CPU time.
    return fenced(study_text("demo", "run").rpartition("\n  2 s simulated")[0])


def handle():
    # Without the last line, which has the time.
    return fenced(study_text("handle", "run").rpartition("\n  420 rollouts in")[0])


def few_iterations():
    return fenced(study_text("demo", "few_iterations", "err"))


def hand():
    lines = study_text("hand", "hand").splitlines()
    end = next(i for i, line in enumerate(lines) if line.startswith("sources"))
    return fenced("\n".join(line for line in lines[:end] if not line.startswith("  predicted from")))


def formats():
    return table(["format", "ending", "for", "of", "needs"],
                 [[f"`{name}`", ", ".join(f"`{ending}`" for ending in endings), text.replace("--time", "`--time`"), of,
                   f"`{needs}`" if needs else ""]
                  for name, endings, text, of, needs in json.loads(study_text("formats", "formats"))])


def poses():
    rows = []
    titles = {"implicit": "`implicit.yaml`, 8 Hz, weight and tissue compensated",
              "integral": "`integral.yaml`, 60 Hz, nothing fed forward", "explicit": "`explicit.yaml`, 2.7 Hz, compensated"}
    for controller, steps in CONTROLLERS.items():
        for step in steps:
            runs = [study_json("poses", f"{controller}_{step}_{person}", "summary.json") for person in PERSONS]
            worst = lambda name: max(criterion(run, name) for run in runs)
            rows.append([titles[controller], f"{step} ms", number(math.degrees(worst("steady_error"))),
                         number(100 * worst("overshoot")), number(1e3 * worst("joint_gap"))])
    return table(["controller", "step", "steady error, deg", "overshoot, %", "joint gap, mm"], rows)


def tracking():
    rows = []
    titles = {"gravity": "`world_step`, 1 ms", "weightless": "the same without gravity",
              "articulated": "`engine: articulated`, 1 ms", "articulated_20ms": "`engine: articulated`, 20 ms"}
    for label, title in titles.items():
        run = study_json("tracking", label, "summary.json")
        rows.append([title, number(math.degrees(criterion(run, "steady_error"))),
                     number(math.degrees(criterion(run, "largest_error"))), number(100 * criterion(run, "overshoot")),
                     number(1e3 * criterion(run, "joint_gap")), number(run["time"]["times_real_time"])])
    return table(["run", "steady error, deg", "largest error, deg", "overshoot, %", "joint gap, mm",
                  "times real time"], rows)


def grasp():
    rows = []
    for entry in study_json("grasp", "both", "grasps.json"):
        # An object that was lost has no figures.
        of = lambda key, factor=1: None if entry[key] is None else factor * entry[key]
        rows.append([entry["scene"].removeprefix("grasp_"), entry["side"], "yes" if entry["held"] else f"**{entry['outcome']}**",
                     number(of("slip_m_per_s", 1e6)), slashed([of("shaken_shift_m", 1e3), of("shift_m", 1e3)]),
                     number(of("turn_rad", math.degrees(1))), of("contacts"), number(of("normal_force_N")),
                     number(of("epsilon"))])
    return table(["scene", "hand", "held", "slip in the hold, µm/s", "moved in / after the shake, mm", "turned, deg",
                  "contacts", "grip, N", "epsilon"], rows)


def agreement():
    found = study_json("agreement", "run", "agreement.json")
    of = lambda count: f"{count['same']} of {count['of']}"
    rows = [[", ".join(pair["ways"]), of(pair["same_verdict"]), of(pair["same_verdict_not_marginal"]),
             slashed([100 * pair["grip_difference_median"], 100 * pair["grip_difference_most"]]), of(pair["grip_within_a_tenth"]),
             slashed([1e6 * slip for slip in pair["slip_median_m_per_s"]]), pair["slip_below_floor"],
             of(pair["slip_within_a_tenth"]) if pair["slip_within_a_tenth"]["of"] else "none"]
            for pair in found["pairs"]]
    refused = f"; {len(found['refused'])} more were refused by the grip" if found["refused"] else ""
    return (f"{found['draws']} draws, seed {found['seed']}, {found['cpu_s'] / 60:.0f} minutes of CPU time{refused}.\n\n" +
            table(["engines (`/4`: a quarter of the step)", "same verdict", "where not marginal", "grip differs by, median / at most, %",
                   "within 10 %", "slip, median of each, µm/s", f"both below {1e6 * found['slip_floor_m_per_s']:g} µm/s",
                   "of the others within 10 %"], rows))


def why_different(entry):
    """What of a difference the runs show."""
    if entry["turning"]:
        return f"marginal: {entry['turning']} turns it"
    held = {said["way"]: said["held"] for said in entry["says"]}
    ode, articulated = held["ode/4"] == held["articulated"], held["articulated/4"] == held["ode"]
    if ode and not articulated:
        return "the step of ODE: a quarter of it gives the articulated engine's verdict"
    if articulated and not ode:
        return "the step of the articulated engine: a quarter of it gives ODE's verdict"
    return "both verdicts turn with the step" if ode else "no step: both verdicts stay at a quarter of it"


def agreement_differences():
    rows = []
    for entry in study_json("agreement", "run", "agreement.json")["differences"]:
        share = lambda margin: "" if margin is None else f" ({100 * margin:.0f} %)"
        said = [one["outcome"].split(" at ")[0] + share(one["margin"]) for one in entry["says"]]
        rows.append([entry["draw"], f"{1e3 * entry['mass_kg']:.0f} g, {number(entry['friction'])}", *said, why_different(entry)])
    if not rows:
        rows = [["none"] + [""] * 6]
    return table(["draw", "mass, friction", "ODE (margin)", "articulated", "articulated/4", "ODE/4", "why"], rows)


STEP_SETS = {"draws": "random grasps of a box", "shipped": "shipped grasps", "climbs": "climbs", "interlace": "two hands interlace", "drop": "a dropped hand",
             "suite": "the suite's grasps"}
STEP_ENGINES = {"articulated": "articulated", "ode": "ODE", "mujoco4": "MuJoCo 4.0", "drake": "Drake 1.51"}
STEP_TERMS = {"": "max(c, h k)", "servos": "c + h k of servos", "pads and servos": "c + h k of pads and servos"}


def pair_of(median, most, scale):
    return "" if median is None else slashed([scale * median, scale * most])


def contact_step():
    """Not of finest steps, which everything is compared with."""
    rows = []
    found = [each for each in study_json("contact_step", "run", "contact_step.json")["summary"] if not each["term"]]
    for each in found:
        if each["step_ms"] == min(other["step_ms"] for other in found if (other["set"], other["engine"]) == (each["set"], each["engine"])):
            continue
        rows.append([STEP_SETS[each["set"]], STEP_ENGINES[each["engine"]], f"{each['step_ms']:g}", f"{each['right']} of {each['of']}",
                     pair_of(each["margin_off_median"], each["margin_off_most"], 100), pair_of(each["force_off_median"], each["force_off_most"], 100),
                     pair_of(each["place_off_median"], each["place_off_most"], 1e3), number(each["cost"]) if each["cost"] else ""])
    return table(["scenes", "engine", "step, ms", "right verdicts", "margin off, points", "force off, %", "place off, mm", "cost"], rows)


def contact_step_terms():
    rows = [[STEP_TERMS[each["term"]], f"{each['step_ms']:g}", f"{each['right']} of {each['of']}", number(100 * each["margin_off"]), number(100 * each["force_off"]),
             number(1e3 * each["place_off"])] for each in study_json("contact_step", "run", "contact_step.json")["terms"]]
    return table(["damping in a step", "step, ms", "right verdicts", "margin off, points", "force off, %", "place off, mm"], rows)


def climb():
    runs = {label: study_json("climb", label, "climbs.json") for label in ("both", "slippery", "2ms", "articulated")}
    def load(label, scene, side="right"):
        for entry in runs[label]:
            if entry["scene"].endswith(scene) and entry["side"] == side:
                return entry
        raise Missing(f"{scene} in out/docs/climb/{label}/climbs.json")
    rows = []
    for scene, title in CLIMBS.items():
        right = load("both", scene)
        rows.append([title, *(number(load("both", scene, side)["load_N"], 4) for side in ("right", "left")),
                     f"{100 * right['load_over_norm']:.0f} %",
                     *(number(load(label, scene)["load_N"], 3) for label in ("slippery", "2ms", "articulated"))])
    return table(["load carried by the median man", "right, N", "left, N", "of the norm", "friction 0.05, N",
                  "2 ms, N", "`--engine articulated`, N"], rows)


def climb_edges():
    rows = []
    for label, title in {"both": "edge of 20 mm", "15mm": "edge of 15 mm", "10mm": "edge of 10 mm",
                         "200Ns": "edge of 20 mm, load growing by 200 N/s",
                         "half_strength": "edge of 20 mm, half the grip strength",
                         "woman": "edge of 20 mm, median woman"}.items():
        entry = next(e for e in study_json("climb", label, "climbs.json")
                     if e["scene"].endswith("half_crimp") and e["side"] == "right")
        rows.append([title, number(entry["load_N"], 3), f"{100 * entry['load_over_norm']:.0f} %"])
    return table(["half crimp, right hand", "load carried, N", "of the norm"], rows)


def accuracy_rows(study, label="run"):
    """Method -> step in ms -> row of those without a fault, in the study's order."""
    data = study_json(study, label, "accuracy.json")
    methods = {}
    for row in data["rows"]:
        if "fault" not in row:
            methods.setdefault(row["method"], {})[round(1e3 * row["step_s"], 6)] = row
    return methods


OWN_STEPS = re.compile(r"stabilised_gear|dormand_prince|RKM|^slip")


def accuracy_table(steps, methods, digits):
    rows = []
    for name, found in methods.items():
        if OWN_STEPS.search(name):
            row = found[10]
            cells = [f"{number(row['rate_error_rms'], digits)} (own steps)"] + [""] * (len(steps) - 1)
            first, cost = row["early_rate_error_rms"], [row["cpu_seconds_per_second"]]
        else:
            cells = [number(found[step]["rate_error_rms"], digits) if step in found else "-" for step in steps]
            first = found[1]["early_rate_error_rms"] if 1 in found else None
            cost = [found[step]["cpu_seconds_per_second"] for step in (1, 0.1) if step in found]
        rows.append([name, *cells, number(first), slashed([1e3 * each for each in cost])])
    head = ["method", *(f"{step:g} ms" for step in steps), "early, at 1 ms", "CPU ms per s, 1 / 0.1 ms"]
    return table(head, rows)


def accuracy():
    methods = {name: rows for name, rows in accuracy_rows("accuracy").items() if "contact" not in name}
    return accuracy_table((10, 2, 1, 0.5, 0.1), methods, 2) + measured_on(study_json("accuracy", "run", "accuracy.json"))


def accuracy_cheapest():
    best = []
    for name, found in accuracy_rows("accuracy").items():
        if "contact" not in name:
            best += [(row["cpu_seconds_per_second"], row["rate_error_rms"], name, step) for step, row in found.items()]
    rows = []
    for error in (0.1, 0.03, 0.01, 3e-3, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9):
        good = sorted(entry for entry in best if entry[1] <= error)
        if not good:
            continue
        other = next((entry for entry in good if not entry[2].startswith("Articulated")), None)
        text = lambda entry: entry[2] + ("" if OWN_STEPS.search(entry[2]) else f", {entry[3]:g} ms")
        rows.append([number(error, 1), text(good[0]), number(1e3 * good[0][0]), text(other) if other else "none",
                     number(1e3 * other[0]) if other else ""])
    return table(["error at most, m/s", "cheapest", "CPU ms per s", "cheapest of the others", "CPU ms per s"],
                 rows)


def accuracy_contact():
    steps = (10, 5, 2, 1, 0.5, 0.1)
    rows = [[name, *(number(found[step]["rate_error_rms"]) if step in found else "-" for step in steps)]
            for name, found in accuracy_rows("accuracy").items() if "contact" in name]
    return table(["method, contact", *(f"{step:g} ms" for step in steps)], rows)


def thesis():
    return accuracy_table((10, 5, 1, 0.1), accuracy_rows("2017"), 3)


def accuracy_hands():
    return accuracy_table((5, 2, 1, 0.5, 0.1), accuracy_rows("hands"), 2)


def effects(label="run"):
    data = study_json("effects", label, "effects.json")
    rows = [["all", number(1e-3 * data["cpu_ns_per_step"]), "", "", ""]]
    for row in data["rows"]:
        name = row["effect"] + ("".join(f" and {other}" for other in row["with"]))
        if "fault" in row:
            rows.append([f"without {name}", "-", row["fault"], "", ""])
            continue
        rows.append([f"without {name}", number(1e-3 * row["cpu_ns_per_step"]),
                     f"{number(1e-3 * row['saved_ns_per_step'])} ± {number(1e-3 * row['noise_ns'], 1)}",
                     number(row["angle_largest_deg"]["value"]), number(row["displacement_largest_mm"]["value"])])
    return table(["effects", "CPU of a step, µs", "saved, µs", "largest change of an angle, deg",
                  "largest change of a position, mm"], rows) + measured_on(data)


def shown(estimate, digits=2):
    """A figure with its interval."""
    if not estimate:
        return "-"
    return f"{estimate['value']:.{digits}f} ({estimate['low']:.{digits}f} to {estimate['high']:.{digits}f})"


def rollouts():
    rows = []
    for name in ("power_can", "pinch", "free_fall", "free_fall_articulated"):
        data = study_json("rollouts", name, "summary.json")
        rows.append([f"**{data['title']}**, {data['rollouts']:,} rollouts" + (" (articulated)" if "articulated" in name else ""),
                     "", f"**{shown(data['held']['share'])}**", "", ""])
        for key, effect in data["keys"].items():
            ends = effect["shares"][0], effect["shares"][-1]
            part = (lambda e: f"{e['value']}: {e['share']['value']:.2f}") if "value" in ends[0] else (
                lambda e: f"{e['from']:.3g} to {e['to']:.3g}: {e['share']['value']:.2f}")
            rows.append([f"`{key}`", shown(effect.get("rank_correlation")), "", *map(part, ends)])
    return table(["varied", "rank correlation with held", "share held", "of the lowest tenth", "of the highest tenth"], rows)


def contacts():
    path = OUT / "contacts" / "contacts" / "contacts_cost.csv"
    if not path.exists():
        raise Missing(path.relative_to(ROOT))
    methods = {}
    with path.open() as file:
        for row in csv.DictReader(file):
            methods.setdefault(row["method"], []).append(row)
    rows = []
    for at in zip(*methods.values()):
        rows.append([at[0]["slabs"], *(f"{number(1e-3 * float(row['cpu_per_step[ns]']))} ({float(row['contacts']):.0f})"
                                       for row in at)])
    return table(["slabs", *(f"`{name}`, µs (contacts)" for name in methods)], rows)


def severity(row):
    """Figure over limit, inverse for a lower limit; infinite without a figure."""
    value = math.inf if row["measured"] is None else float(row["measured"])
    if row["measured"] is None or math.isnan(value):
        return math.inf
    if "least" in row:
        return row["least"] / value if value > 0 else math.inf
    return value / row["most"] if row["most"] > 0 else 0 if value <= row["most"] else math.inf


def stability_row(rows):
    """The worst figures of a case that must hold, and its known shortfalls."""
    worst = {}  # by measure, way and step: of all variants
    for row in rows:
        key = row["measure"], row["way"], row["step_s"]
        if key not in worst or severity(row) > severity(worst[key]):
            worst[key] = row
    shown_figure = lambda row: f"{float(row['measured']):.3g} {row['unit']}".rstrip()
    held, known = [], []
    for measure in dict.fromkeys(row["measure"] for row in rows):
        of = [row for row in worst.values() if row["measure"] == measure]
        if measure == "refused":
            held.append(f"{sum(row['measured'] == 0 for row in of)} of {len(of)} rejected with a message")
            continue
        must = [row for row in of if row["verdict"] != "short (known)"]
        if must:
            most = max(must, key=severity)
            limit = f"≥ {most['least']:.3g}" if "least" in most else f"≤ {most['most']:.3g}"
            short = "" if most["verdict"].startswith("held") else " **falls short**"
            held.append(f"{measure} {shown_figure(most) if most['measured'] is not None else '-'} ({limit}){short}")
        texts = []
        for diverged in (False, True):
            ways = {}
            for row in of:
                if row["verdict"] == "short (known)" and ("fault" in row) == diverged:
                    ways.setdefault(row["way"], []).append(row)
            if ways:
                head = "diverges" if diverged else "to " + shown_figure(max(sum(ways.values(), []), key=severity))
                steps = lambda found: ", ".join(f"{1e3 * row['step_s']:g}" for row in found)
                texts.append(f"{head}: " + ", ".join(f"{way} at {steps(found)} ms" for way, found in ways.items()))
        if texts:
            known.append(measure + " " + "; ".join(texts))
    return "; ".join(held), "; ".join(known)


def stability():
    data = study_json("stability", "run", "stability.json")
    verdicts = [row["verdict"] for case in data["cases"] for row in case["rows"]]
    short, failed = verdicts.count("short (known)"), verdicts.count("FELL SHORT")
    quick = ", with `--quick`" if data["quick"] else ""
    text = (f"{len(data['cases'])} cases{quick}: {len(verdicts)} figures, of which {len(verdicts) - short - failed} hold, "
            f"{short} are known shortfalls, and {failed} are other shortfalls.\n\n")
    rows = [(case["name"], *stability_row(case["rows"])) for case in data["cases"]]
    return text + table(["case", "worst figures", "known shortfalls"], [row for row in rows if row[2]])


def stability_cases():
    cases = re.findall(r"^  - name: (\S+)\n    title: (.*)\n    oracle: (.*)$",
                       (ROOT / "config" / "stability.yaml").read_text(), re.M)
    return table(["case", "description", "oracle"], cases)


def bench():
    """Name without the aggregate -> entry of the medians."""
    path = OUT / "speed" / "bench.json"
    if not path.exists():
        raise Missing(path.relative_to(ROOT))
    entries = json.loads(path.read_text())["benchmarks"]
    return {entry["run_name"].split("/manual_time")[0].split("/iterations")[0].split("/real_time")[0]: entry
            for entry in entries if entry.get("aggregate_name") == "median"}


def passes():
    path = OUT / "passes" / "bench.json"
    if not path.exists():
        raise Missing(path.relative_to(ROOT))
    rows = []
    for entry in json.loads(path.read_text())["benchmarks"]:
        _, name, most, *_ = entry["name"].split("/")
        rows.append([{"box": "box, friction 0.9", "slippery_box": "box, friction 0.6"}[name], most, number(entry["us"], 3),
                     number(entry["passes"], 3), slashed([100 * entry["beyond_mean"], 100 * entry["beyond_most"]]),
                     number(entry["grip"], 4), number(entry["shift_mm"], 3), "yes" if entry["held"] else "no"])
    return table(["grasp", "most passes", "a step, µs", "passes a step", "friction beyond its cone, mean / at most, %",
                  "grip, N", "shift after the shake, mm", "held"], rows)


def speed():
    found = bench()
    rows = []
    for key, title in {"two_hands_world_step": "one step of two hands, `world_step`: stops, tissue, checks, ledger",
                       "two_hands_quick_step": "the same, `quick_step`, its residual measured",
                       "slider_crank_world_step": "slider-crank, `world_step`",
                       "slider_crank_quick_step": "slider-crank, `quick_step`"}.items():
        entry = found[f"loop_against_bare_ode/{key}"]
        rows.append([title, f"{number(entry['candidate_us'])} µs", f"{entry['ratio']:.2f} × the bare ODE loop"])
    for key in ("implicit", "explicit"):
        entry = found[f"control_share/{key}"]
        rows.append([f"control of one hand, {key} form", f"{number(1e-3 * entry['control_ns'])} µs",
                     f"{number(entry['share'])} of the step that it drives"])
    for key, title in {"world_step": "mug held in the whole hand, `world_step`",
                       "quick_step_50": "the same, `quick_step` 50"}.items():
        entry = found[f"grasp/{key}"]
        rows.append([title, "", f"{number(entry['of_real_time'])} of real time, {entry['contacts']:.0f} contacts"])
    for key, title in {"person_to_world": "from a person to a world ready to step, both hands",
                       "frame/1280": "a picture of two hands, 1280 × 960", "read_state": "poses of all bodies, articulated engine"}.items():
        entry = found[key]
        rows.append([title, f"{number(entry['real_time'])} {entry['time_unit'].replace('us', 'µs')}", ""])
    return table(["what", "time", "compared with"], rows)


def environments():
    path = OUT / "environment" / "bench.json"
    if not path.exists():
        raise Missing(path.relative_to(ROOT))
    found = {entry["run_name"].split("/manual_time")[0].split("/iterations")[0].split("/real_time")[0]: entry
             for entry in json.loads(path.read_text())["benchmarks"]}
    def of(key, counter="cpu_time"):
        return found[key][counter]
    rows = [["steps of one hand with stops, tissue and control of all joints, one core",
             f"{1e-6 * of('batch_steps/smooth', 'hand_steps_per_s'):.2f} million a second"],
            ["the same with self-contact tested and none touching",
             f"{1e-6 * of('batch_steps/self_contact', 'hand_steps_per_s'):.2f} million a second"],
            ["the same through all poses, of which some touch themselves",
             f"{1e-6 * of('batch_steps/self_contact_all_poses', 'hand_steps_per_s'):.2f} million a second"],
            ["the same hand driven by muscles, rigid and elastic tendons",
             " and ".join(f"{1e-6 * of(f'muscle_batch_steps/{key}', 'hand_steps_per_s'):.2f}" for key in ("rigid", "elastic"))
             + " million a second"],
            ["the same hand holding a mug", f"{of('batch_steps/mug', 'hand_steps_per_s'):,.0f} a second, "
                                            f"{of('batch_steps/mug', 'contacts'):.0f} contacts"],
            ["a batch of one, compared with its bare engine",
             " and ".join(f"{of(f'batch_of_one_against_engine/{key}', 'ratio'):.3f} (`{key}`)"
                          for key in ("two_hands", "dropped_hand"))],
            ["two threads, compared with one", f"{of('two_threads', 'times_as_fast'):.2f} times as fast"],
            ["`reset()` of a hand, of a grasp, of a grasp with mass and gains drawn",
             ", ".join(f"{number(of(f'reset/{key}'))}" for key in ("every_pose", "grasp_pinch", "grasp_pinch_drawn")) + " µs"],
            ["memory of an environment of a batch after 300 steps: two hands, a pinch, a mug",
             ", ".join(f"{of(f'memory/{key}', 'kB'):.0f}" for key in ("every_pose", "grasp_pinch", "grasp_cup")) + " kB"]]
    return table(["what", "measured"], rows)


def speed_lanes():
    found = bench()
    rows = [[f"`{key}`: {found[f'step_against_bare_ode/{key}'].get('label', '')}",
             number(found[f"step_against_bare_ode/{key}"]["candidate_us"]),
             f"1/{1 / found[f'step_against_bare_ode/{key}']['ratio']:.0f}"]
            for key in ("chosen", "four_lanes", "one_lane") if f"step_against_bare_ode/{key}" in found]
    return table(["one step of one hand: gravity, stops, tissue, 20 servos", "µs", "of a bare `dWorldStep`"], rows)


def speed_load():
    found = bench()
    rows = []
    for key, title in {"step_against_mujoco/without_contact": "gravity, stops, servos; no contact",
                       "step_against_mujoco/self_contact_tested": "the same, self-contact tested, none touching",
                       "grasp_against_mujoco/tripod_as_exported": "ball held by three fingers; MuJoCo as exported",
                       "grasp_against_mujoco/cylinder_100mm_as_exported": "cylinder of 100 mm held; MuJoCo as exported",
                       "grasp_against_mujoco/cup_as_exported": "mug held; MuJoCo as exported",
                       "grasp_against_mujoco/cup_impratio_1e6": "mug held; MuJoCo with `impratio` 1e6",
                       "grasp_against_ode/cup": "mug held; ODE `world_step`"}.items():
        if key not in found:
            continue
        entry = found[key]
        slip = (f"{number(entry['slip'])} / {number(entry['slip_yardstick'])}" if "slip" in entry else "")
        contacts = f"{entry['contacts']:.0f}" if "contacts" in entry else ""
        rows.append([title, contacts, number(entry["candidate_us"]), number(entry["yardstick_us"]), number(entry["ratio"]), slip])
    return table(["load", "contacts", "articulated, µs", "other engine, µs", "ratio", "slip, µm/s: articulated / other"], rows)


def pinch_table(text):
    pattern = re.compile(r"(\w+) +([\d.]+)  slip um/s: world_step (\S+), quick_step 50 (\S+); elliptic (\S+), "
                         r"impratio 10 (\S+), noslip 3 (\S+); tilt")
    found = {}
    for shape, ratio, *slips in pattern.findall(text):
        found.setdefault(shape, {})[ratio] = [float(slip) for slip in slips]
    cell = lambda slip: "lost" if abs(slip) > 1e4 else number(abs(slip), 1)
    rows = [[shape, *(f"{cell(low)} / {cell(high)}" for low, high in zip(found[shape]["1.05"], found[shape]["38.00"]))]
            for shape in found]
    if not rows:
        raise Missing("figures of the pinch")
    return table(["object", "`world_step`", "`quick_step` 50", "MuJoCo, elliptic cone", "and `impratio` 10",
                  "and `noslip_iterations` 3"], rows)


def pinch():
    return pinch_table(study_text("pinch", "test"))


# Comparison with the newest other engines.

LOST = 1e4  # um/s
ENGINES = {"handsim": "handsim", "mujoco": "MuJoCo", "drake": "Drake"}


def peer_cases(engine):
    path = OUT / "peers" / f"cases_{engine}.json"
    if not path.exists():
        raise Missing(path.relative_to(ROOT))
    return json.loads(path.read_text())


def peer_bench():
    path = OUT / "peers" / "bench.json"
    if not path.exists():
        raise Missing(path.relative_to(ROOT))
    return {entry["run_name"].split("/manual_time")[0]: entry for entry in json.loads(path.read_text())["benchmarks"]
            if entry.get("aggregate_name") == "median"}


def suite_engines():
    """Of the suite, by the name of tests/peers/suite.py: what the judge says of each engine, with its cases by name."""
    found = study_json("suite", ".", "suite.json")["engines"]
    return {engine["name"]: {**engine, "cases": {case["case"]: case for case in engine["cases"]}} for engine in found}


def is_quiet(case):
    """Whether creep and contact forces of a grasp are within their limits."""
    return all(figure["held"] is not False for figure in case["figures"] if figure["name"] in ("creep", "weight"))


def suite_table():
    engines, rows = suite_engines(), []
    own = engines["articulated"]["cases"]
    for engine in engines.values():
        grasps = [case for name, case in engine["cases"].items() if name.startswith("grasp_")]
        held = [case for case in grasps if case["verdict"] == "held"]
        others = [case for name, case in engine["cases"].items() if not name.startswith("grasp_")]
        grips = sorted(figure["value"] for case in grasps for figure in case["figures"] if figure["name"] == "grip" and figure["value"] is not None)
        both = [name for name, case in engine["cases"].items() if case["cpu_s"] and not case.get("why") and own[name]["cpu_s"]]
        cost = sum(engine["cases"][name]["cpu_s"] for name in both) / sum(own[name]["cpu_s"] for name in both) if both else None
        grip = f"{number(grips[len(grips) // 2], 3)} ({number(grips[0], 3)} to {number(grips[-1], 3)})" if grips else ""
        rows.append([f"{engine['engine']} {engine['version']}", engine["options"], f"{len(held)} of {len(grasps)}",
                     f"{sum(map(is_quiet, held))}", f"{sum(case['verdict'] == 'held' for case in others)} of {len(others)}", grip, number(cost)])
    return table(["engine", "options", "grasps held", "of these quiet", "other cases held", "grip", "cost"], rows)


def suite_cases():
    engines = suite_engines()
    names = list(next(iter(engines.values()))["cases"])
    rows = []
    for name in dict.fromkeys(name.partition(".")[0] for name in names):
        own = [each for person in ("", ".large_man", ".median_man", ".small_woman") if (each := name + person) in names]
        row = [f"`{name}`"]
        for engine in engines.values():
            verdicts = [engine["cases"][each]["verdict"] for each in own if each in engine["cases"]]
            row.append(", ".join(dict.fromkeys(verdicts) if len(set(verdicts)) == 1 else verdicts) or "-")
        rows.append(row)
    return table(["case", *(f"{engine['engine']} {engine['version']}" for engine in engines.values())], rows)


def versions_of_peers():
    """Of the peers, ODE and the articulated engine on this processor."""
    found = []
    for engine in ENGINES:
        try:
            found += peer_cases(engine)["versions"]
        except Missing:
            pass
    return sorted(text for text in set(found) if not text.startswith("dae") and text != "articulated, vector unit of the build")


def peers_speed():
    found = peer_bench()
    mujoco = next(entry["label"] for name, entry in found.items() if name == "hand_to_engine")
    titles = {"step_against_mujoco/without_contact": "step of a hand: gravity, stops, tissue, 20 servos; no contact",
              "step_against_mujoco/self_contact_tested": "the same, self-contact tested, none touching"}
    for grasp, what in {"tripod": "ball, three fingers", "cylinder_100mm": "cylinder", "cup": "mug"}.items():
        for setting in ("as_exported", "impratio_1", "impratio_1e6", "noslip_100", "pyramids"):
            entry = found.get(f"grasp_against_mujoco/{grasp}_{setting}", {})
            contacts, there = entry.get("contacts", 0), entry.get("contacts_yardstick", 0)
            titles[f"grasp_against_mujoco/{grasp}_{setting}"] = (
                f"{what} held, {contacts:.0f} contacts here, {there:.0f} there; `{setting.replace('_', ' ')}`")
    titles["hand_to_engine"] = "a hand: a person's YAML to an engine here, MJCF to a model there"
    batch = "1,024 controlled hands on 2 threads, wall time of a step of one, {} steps in a call; `mjBatch` there, `Batch` here"
    titles["hands_on_two_threads/steps_10"] = batch.format(10)
    titles["hands_on_two_threads/steps_40"] = batch.format(40)
    titles["hands_on_two_threads/self_contact_40"] = batch.format(40) + "; self-contact tested, none touching"
    titles["step_against_pinocchio/aba"] = "step of a hand here, Pinocchio's ABA alone there"
    titles["step_against_pinocchio/rnea"] = "step of a hand here, Pinocchio's RNEA alone there"
    rows = []
    for name, title in titles.items():
        if name not in found or "ratio" not in found[name]:
            continue
        entry = found[name]
        creep = grip = ""
        if "slip" in entry:
            lost = entry["slip_yardstick"] > LOST
            creep = f"{number(entry['slip'])} / {'lost' if lost else number(entry['slip_yardstick'])}"
            grip = f"{number(entry['grip'])} / {'lost' if lost else number(entry['grip_yardstick'])}"
        rows.append([title, number(entry["candidate_us"]), number(entry["yardstick_us"]), number(entry["ratio"]), creep, grip])
    return table([f"what ({mujoco})", "articulated, µs", "the peer, µs", "ratio", "creep, µm/s: here / there",
                  "sum of normal forces, N: here / there"], rows)


def peers_equal():
    """MuJoCo's fastest setting that creeps no more than the engine here, and the one that creeps least."""
    found, rows = peer_bench(), []
    for grasp, what in {"tripod": "ball, three fingers", "cylinder_100mm": "cylinder", "cup": "mug"}.items():
        head = f"grasp_against_mujoco/{grasp}_"
        entries = {name.removeprefix(head).replace("_", " "): entry for name, entry in found.items() if name.startswith(head)}
        if not entries:
            continue
        own = next(iter(entries.values()))
        equal = [name for name, entry in entries.items() if entry["slip_yardstick"] <= entry["slip"]]
        least = min(entries, key=lambda name: entries[name]["slip_yardstick"])
        name = min(equal, key=lambda name: entries[name]["yardstick_us"]) if equal else least
        rows.append([f"{what}, {own['contacts']:.0f} contacts", f"`{name}`" + ("" if equal else ", the least creep: none is equal"),
                     number(own["candidate_us"]), number(entries[name]["yardstick_us"]), number(entries[name]["ratio"]),
                     slashed([own["slip"], entries[name]["slip_yardstick"]])])
    return table(["held", "MuJoCo's setting", "articulated, µs", "MuJoCo, µs", "ratio", "creep, µm/s: here / there"], rows)


def peers_pinch():
    text = study_text("peers", "pinch")
    return pinch_table(text)


def peers_accuracy():
    data = study_json("peers", "accuracy", "accuracy.json")
    engines = ", ".join(data["versions"]["engines"])
    return accuracy_table((10, 2, 1, 0.5, 0.1), accuracy_rows("peers", "accuracy"), 2) + f"\nEngines: {engines}.\n"


def verdict(ways):
    """The best of some ways: holds, or what it misses most; "too slow" if the limit of CPU time left none a verdict."""
    if not ways:
        return "-"
    ways = [way for way in ways if "too_slow" not in way]
    if not ways:
        return "too slow"
    best = min(ways, key=lambda way: (not way["held"], way["worst"].get("severity", math.inf)))
    if best["held"]:
        return "holds"
    worst = best["worst"]
    if worst["fault"]:
        return "**breaks off**"
    return f"**{worst['measure']}** × {number(worst['severity'])}" if "severity" in worst else f"**{worst['measure']}**"


def case_columns():
    """Case -> column -> ways, and what was left out of which column."""
    columns, out = {}, {}
    for engine in ENGINES:
        try:
            cases = peer_cases(engine)["cases"]
        except Missing:
            continue
        for case in cases:
            for way in case["ways"]:
                name = way["way"]
                if engine == "handsim":
                    column = next((kind for kind in ("articulated", "ODE") if name.startswith(kind)), None)
                elif engine == "mujoco":
                    column = "MuJoCo, as exported" if name == "Euler, as exported" else "MuJoCo, best setting"
                else:
                    column = "Drake, best setting"
                if column and ("worst" in way or "too_slow" in way):
                    columns[column] = True
                    out.setdefault(case["name"], {}).setdefault(column, []).append(way)
    return list(columns), out


def peers_cases():
    columns, cases = case_columns()
    rows = [[f"`{name}`", *(verdict(found.get(column)) for column in columns)] for name, found in cases.items()
            if any(not column.startswith(("articulated", "ODE")) for column in found)]
    return table(["case", *columns], rows) + f"\nVersions: {', '.join(versions_of_peers())}.\n"


def peers_settings():
    rows = []
    for engine, title in ENGINES.items():
        try:
            cases = [case for case in peer_cases(engine)["cases"] if case["ways"]]
        except Missing:
            continue
        if engine == "handsim":
            continue
        names = list(dict.fromkeys(way["way"] for case in cases for way in case["ways"]))
        for name in names:
            ways = [way for case in cases for way in case["ways"] if way["way"] == name]
            held = [way["held"] for way in ways if "held" in way]
            slow = sum("too_slow" in way for way in ways)
            rows.append([f"{title}: {name}", f"{sum(held)} of {len(held)}", f"{slow or ''}"])
    return table(["setting", "cases held", "too slow"], rows)


def peers_ahead():
    """Cases that a peer holds and one of ours does not."""
    columns, cases = case_columns()
    rows = []
    for name, found in cases.items():
        holds = [column for column in columns if not column.startswith(("articulated", "ODE"))
                 and any(way.get("held") for way in found.get(column, []))]
        for ours in ("articulated", "ODE"):
            ways = found.get(ours)
            if holds and ways and not any(way["held"] for way in ways):
                held_by = [way["way"] for column in holds for way in found[column] if way.get("held")]
                rows.append([f"`{name}`", ours, verdict(ways), "; ".join(held_by)])
    return table(["case", "of ours", "falls short by", "held by"], rows)


def torques_of(label):
    """Columns `_active` of a torques.sto: name -> values."""
    path = OUT / "bench" / label / "torques.sto"
    if not path.exists():
        raise Missing(path)
    lines = path.read_text().splitlines()
    names = lines[6].split("\t")
    rows = [line.split("\t") for line in lines[7:]]
    return {name.removesuffix("_active"): [float(row[i]) for row in rows]
            for i, name in enumerate(names) if name.endswith("_active")}


def muscles():
    path = OUT / "muscles" / "bench.json"
    if not path.exists():
        raise Missing(path.relative_to(ROOT))
    found = {entry["run_name"].split("/")[1]: entry for entry in json.loads(path.read_text())["benchmarks"]}
    return table(["a hand with", "step without, µs", "step with, µs", "ratio", "added, µs"],
                 [[title, *(number(found[key][counter]) for counter in ("yardstick_us", "candidate_us", "ratio", "added_us"))]
                  for key, title in {"excited": "41 muscles and the bands, all muscles excited",
                                     "elastic": "the same, elastic tendons",
                                     "short_range": "rigid tendons and a short-range stiffness", "short_range_elastic": "elastic tendons and a short-range stiffness",
                                     "at_rest": "rigid tendons, muscles at rest", "bands_alone": "the bands alone"}.items()])


def learning():
    path = OUT / "learning" / "learning.json"
    if not path.exists():
        raise Missing(path.relative_to(ROOT))
    def reached(of):
        minutes = of["cpu_minutes_to_80"]
        return f"{100 * of['success']:.0f} %, " + (f"80 % after {minutes:.1f} min" if minutes else "never 80 %")
    return table(["task", "beside", "steps in a second of CPU time", "theirs", "ratio", "success", "theirs"],
                 [[f"`{of['task']}` by {of['drive']}", f"`{of['beside']}`", f"{of['steps_per_s']:,.0f}", f"{of['peer_steps_per_s']:,.0f}",
                   f"{of['ratio']:.2g}", *(reached(of[who]) if who in of else "not run" for who in ("handsim", "peer"))]
                  for of in json.loads(path.read_text())["pairs"]])


def longest_tests():
    """The 40 longest entries of ctest, and all of them, as ctest keeps them: name, runs, mean of their seconds."""
    kept = re.findall(r"^(\S+) ([1-9]\d*) (\S+)$", study_text("tests", "run"), re.M)
    long = set(re.findall(r"Test +#\d+: (\S+)", study_text("tests", "long")))
    entries = sorted(((float(seconds), name, "all" if name in long else "quick") for name, _, seconds in kept), reverse=True)
    rows = [[f"`{name}`", tier, number(seconds)] for seconds, name, tier in entries[:40]]
    for tier in ("quick", "all"):
        of = [seconds for seconds, _, own in entries if tier in ("all", own)]
        rows.append([f"{len(of)} entries together", tier, number(sum(of))])
    return table(["entry of ctest", "tier", "time (s)"], rows)


def skin():
    path = OUT / "skin" / "skin.json"
    if not path.exists():
        raise Missing(path.relative_to(ROOT))
    of = json.loads(path.read_text())
    rows = [*of["persons"].values(), *of["drawn"]]
    largest = [f"{1e3 * max(abs(row[k]) for row in rows):.2f} mm" for k in range(3)]
    depth, one, other = max(of["poses"].values())
    more = [100 * row[3] for row in rows]
    return table(["the skin of the median man, or of 8 shipped persons and 100 drawn ones", "measured"], [
        ["length, breadth and girth at the knuckles against the shapes', 108 persons, at most", ", ".join(largest)],
        ["volume beyond the wrist's joint centre × density against the hand's mass, 108 persons", f"{min(more):.1f} to {max(more):.1f} %"],
        [f"it passes through itself beyond the shapes' own depth in the {len(of['poses'])} poses, at most",
         f"{1e3 * depth:.1f} mm ({one.replace('_', ' ')}, {other.replace('_', ' ')})"],
        ["triangles", f"{of['triangles']:,}"],
        ["CPU time to make it, once for each hand", f"{1e3 * of['make_s']:.0f} ms"],
        ["CPU time of a picture of two hands at 640 x 480; of their shapes",
         f"{1e3 * of['frame_s']['skin']:.0f} ms; {1e3 * of['frame_s']['shapes']:.0f} ms"]])


def validation():
    path = OUT / "validate" / "run" / "validate.csv"
    if not path.exists():
        raise Missing(path.relative_to(ROOT))
    with path.open() as file:
        found = list(csv.DictReader(file))
    short = [row for row in found if row["verdict"] != "within"]
    by_reason = {}
    for row in short:
        by_reason.setdefault(row["reason"] or "no reason known", []).append(row)
    def tally(of):
        inside = sum(float(row["weight"]) for row in of if row["verdict"] == "within")
        return f"{inside:.4g} of {sum(float(row['weight']) for row in of):.4g}" if of else ""

    own = [row for row in found if row["of"] == "people" and row["spread_is"] == "source" and not row["chosen"]]
    rows = [["values of people, spread and conditions of the source", tally(own), ""]]
    rows += [[f"of these {how}", tally([row for row in own if row["value_is"] == how]), ""] for how in ("fitted", "norm", "scaled", "predicted")]
    rows += [["predictions, all", tally([row for row in found if row["value_is"] == "predicted"]), ""],
             ["all values", tally(found), ""]]
    for reason, those in sorted(by_reason.items(), key=lambda item: -len(item[1])):
        names = [re.split(r"[,:]", row["quantity"])[0] for row in those]
        rows.append([reason, str(len(those)), "; ".join(dict.fromkeys(names))])
    return table(["values within one spread, or why rows fall short", "number", "quantities"], rows)


def clinic():
    path = OUT / "clinic" / "run" / "validate.csv"
    if not path.exists():
        raise Missing(path.relative_to(ROOT))
    with path.open() as file:
        found = list(csv.DictReader(file))
    return table(["quantity", "ours", "people", "spread", "unit", "within", "why it may differ"],
                 [[row["quantity"], f"{float(row['ours']):.3g}", f"{float(row['measured']):.3g}", f"{float(row['spread']):.2g}",
                   "" if row["unit"] == "1" else row["unit"], "yes" if row["verdict"] == "within" else "no", row["reason"]] for row in found])


def printed(label):
    path = OUT / "export" / f"{label}.txt"
    if not path.exists():
        raise Missing(path.relative_to(ROOT))
    return path.read_text()


def export_opensim():
    found = re.findall(r"^OpenSim (\S+), (\w+) hands, (\w+): mass (\S+), centre of mass (\S+) m, torques (\S+), angles (\S+) rad",
                       printed("opensim"), re.M)
    if not found:
        raise Missing("OpenSim, which ./dev peers fetches")
    return table([f"OpenSim {found[0][0].split(chr(45))[0]}", "mass, relative", "centre of mass, m", "inverse dynamics, over the largest torque",
                  "OpenSim's inverse kinematics, rad"],
                 [[f"{model} hands, mount {mount}", mass, centre, "-" if mount == "free" else torque, angle]
                  for _, model, mount, mass, centre, torque, angle in found])


def export_muscles():
    text = printed("opensim")
    rest = re.search(r"^OpenSim (\S+), (\d+) muscles at rest: lengths (\S+), arms (\S+), tensions (\S+), torques (\S+)", text, re.M)
    moving = re.search(r"^OpenSim, muscles moving: rates (\S+), tensions at full activation (\S+), at any activation (\S+)", text, re.M)
    if not rest or not moving:
        raise Missing("OpenSim, which ./dev peers fetches")
    version, count, lengths, arms, tensions, torques = rest.groups()
    rates, full, partial = moving.groups()
    return table([f"OpenSim {version.split(chr(45))[0]}, {count} muscles at 20 poses", "largest difference"],
                 [["lengths, relative", lengths], ["moment arms, over the muscle's largest", arms],
                  ["tensions at rest, activations of 0 to 1, over the muscle's largest force", tensions],
                  ["their torques about all axes, by OpenSim's inverse dynamics, over the largest", torques],
                  ["speeds of the lengths with joints at up to 5 rad/s, over the muscle's fastest", rates],
                  ["tensions at these speeds, full activation, over the muscle's largest force", f"{100 * float(full):.1f} %"],
                  ["tensions at these speeds, activations of 0 to 1", f"{100 * float(partial):.1f} %"]])


def export_block():
    text = printed("mujoco")
    flat = re.findall(r"^block of 0.1 on ground of 0.9, 3 m/s at (\d+) deg, after 1 s: (\S+) m in MuJoCo (\S+), (\S+) m here, (\S+) m", text, re.M)
    slope = re.findall(r"^the block on a slope of (\d+) deg, after 1 s: (\S+) m in MuJoCo (\S+), (\S+) m here, (\S+) m", text, re.M)
    if not flat or not slope:
        raise Missing("MuJoCo")
    rows = [[f"pushed off at 3 m/s, {angle}° from its edges", formula, there, here] for angle, there, _, here, formula in flat]
    rows += [[f"down a slope of {angle}°", formula, there, here] for angle, there, _, here, formula in slope]
    return table(["a block of friction 0.1 on ground of 0.9 slides in 1 s, m", "formula", f"MuJoCo {flat[0][2]}", "handsim, articulated"], rows)


def export_grasps():
    found = re.findall(r"^grasp_(\S+) in MuJoCo (\S+): (\d+) contacts, at most (\S+) mm from", printed("mujoco"), re.M)
    if not found:
        raise Missing("MuJoCo")
    return table([f"held in MuJoCo {found[0][1]}", "contacts there", "farthest from its start in 1 s, mm"],
                 [[f"`grasp_{name}`", contacts, way] for name, _, contacts, way in found])


def day_at_the_bench():
    rms = lambda values: math.sqrt(sum(value * value for value in values) / len(values))
    exact, noisy = (study_json("bench", label, "summary.json") for label in ("exact", "tracked"))
    flexion = lambda data: max(hand["finger_flexion_difference_rms_deg"] for hand in data["hands"])
    true, found = torques_of("true_torques"), torques_of("inverse")
    axes = [name for name in true if name.endswith(".flexion") and "thumb" not in name]
    difference = rms([rms([a - b for a, b in zip(true[name], found[name])]) for name in axes])
    check = study_json("bench", "inverse", "summary.json")["forward"]["rms_error_deg"]
    run = study_json("bench", "run", "summary.json")
    errors = [criterion(run, "rms_error"), criterion(run, "largest_error")]
    overlaps = [hand["overlaps"] for hand in noisy["hands"]]
    return table(["step", "figure", "value"], [
        ["track, exact", "angles of the fingers' flexion axes against the true ones, RMS", f"{number(flexion(exact))}°"],
        ["track, 2 mm of noise", "the same", f"{number(flexion(noisy))}°"],
        ["", "noise that it estimates, a coordinate", f"{number(noisy['hands'][0]['noise_mm'])} mm"],
        ["", "hand length; with exact keypoints",
         f"{noisy['person']['hand_length_mm']:.1f} mm; {exact['person']['hand_length_mm']:.1f} mm"],
        ["", "frames of one hand in a second of CPU time", f"{noisy['frames_of_a_hand_per_s']:.0f}"],
        ["", "frames with fingers inside each other, deepest",
         f"{sum(each['frames_overlapping'] for each in overlaps)} of {sum(each['frames_tested'] for each in overlaps)}, "
         f"{number(max(each['deepest_mm'] for each in overlaps))} mm"],
        ["inverse", "torques of the fingers' flexion axes against the true ones, RMS; the torques themselves",
         f"{number(1e3 * difference)} mN m; {number(1e3 * rms([rms(true[name]) for name in axes]))} mN m"],
        ["", "simulation with the torques alone, RMS", f"{number(check)}°"],
        ["run, with contact", "difference from the tracked angles, worst axis: RMS; largest",
         f"{number(math.degrees(errors[0]))}°; {number(math.degrees(errors[1]))}°"]])


# Name of the table -> the study whose files it needs, and the function that makes it.
TABLES = {"tests-longest": ("tests", longest_tests), "skin": ("skin", skin), "validate": ("validate", validation), "clinic": ("clinic", clinic), "learning": ("learning", learning), "export-opensim": ("export", export_opensim), "export-muscles": ("export", export_muscles), "export-block": ("export", export_block), "export-grasps": ("export", export_grasps), "muscles": ("muscles", muscles), "bench": ("bench", day_at_the_bench), "rollouts": ("rollouts", rollouts), "handle": ("handle", handle), "demo": ("demo", demo), "few-iterations": ("demo", few_iterations), "hand": ("hand", hand), "formats": ("formats", formats), "poses": ("poses", poses),
          "tracking": ("tracking", tracking), "grasp": ("grasp", grasp), "agreement": ("agreement", agreement),
          "agreement-differences": ("agreement", agreement_differences), "climb": ("climb", climb), "contact-step": ("contact_step", contact_step),
          "contact-step-terms": ("contact_step", contact_step_terms),
          "climb-edges": ("climb", climb_edges), "accuracy": ("accuracy", accuracy),
          "accuracy-cheapest": ("accuracy", accuracy_cheapest), "accuracy-contact": ("accuracy", accuracy_contact),
          "accuracy-hands": ("hands", accuracy_hands), "2017": ("2017", thesis), "effects": ("effects", effects), "effects-muscles": ("effects", lambda: effects("muscles")), "contacts": ("contacts", contacts),
          "stability": ("stability", stability), "stability-cases": ("stability", stability_cases),
          "passes": ("passes", passes), "speed": ("speed", speed), "speed-lanes": ("speed", speed_lanes), "speed-load": ("speed", speed_load),
          "environment": ("environment", environments), "pinch": ("pinch", pinch), "peers-speed": ("peers", peers_speed), "peers-equal": ("peers", peers_equal), "peers-pinch": ("peers", peers_pinch),
          "peers-accuracy": ("peers", peers_accuracy), "peers-cases": ("peers", peers_cases),
          "peers-settings": ("peers", peers_settings), "peers-ahead": ("peers", peers_ahead), "suite": ("suite", suite_table), "suite-cases": ("suite", suite_cases)}
