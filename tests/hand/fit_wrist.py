#!/usr/bin/env python3
"""Arms about the flexion of the wrist: the coefficients of handmodels/muscles.yaml, on standard output.

Sources: MyoHand, computed by its paths from -40 to 40 deg, and polynomials of nine tendons, published for the whole range.
Up to 40 deg an arm is their mean, or MyoHand alone. Beyond it follows the polynomial; where there is none, it stays what it is at
40 deg: MyoHand's slope must not go on, since retinacula hold the tendons (with it EDM flexed a wrist bent by 55 deg, and
the finger flexors had 28 to 36 mm, where the polynomials have 20 to 22). A cubic is fitted to that over the wrist's range.

    python3 tests/hand/fit_wrist.py
"""
import numpy as np

DEGREE = 3
RANGE = (-70, 75)  # anatomical.yaml [deg]
MEASURED = np.arange(-40, 41, 10)  # of MyoHand [deg]
MYOHAND = {  # [mm], of the tendons in a hand of 178 mm
    "FDP2": (7.67, 8.07, 8.59, 9.21, 11.6, 14.62, 17.47, 20.11, 22.49),
    "FDP3": (7.4, 7.96, 8.63, 9.41, 11.7, 14.8, 17.74, 20.48, 22.96),
    "FDP4": (7.19, 7.82, 8.56, 9.42, 11.83, 14.85, 17.7, 20.34, 22.72),
    "FDP5": (7.0, 7.68, 8.47, 9.37, 11.6, 14.52, 17.26, 19.78, 22.04),
    "FDS2": (9.62, 10.42, 11.27, 12.17, 14.12, 17.26, 20.21, 22.92, 25.34),
    "FDS3": (9.89, 10.7, 11.57, 12.47, 14.63, 17.75, 20.66, 23.34, 25.71),
    "FDS4": (10.49, 11.36, 12.26, 13.18, 14.86, 17.95, 20.84, 23.49, 25.83),
    "FDS5": (10.68, 11.56, 12.47, 13.39, 15.28, 18.39, 21.31, 23.97, 26.32),
    "EDC2": (-22.39, -22.09, -21.1, -19.38, -17.32, -15.46, -13.72, -11.96, -10.13),
    "EDC3": (-24.07, -23.36, -22.3, -20.26, -17.84, -15.12, -13.41, -11.83, -10.14),
    "EDC4": (-23.13, -22.28, -21.26, -19.79, -17.32, -14.56, -12.43, -10.78, -9.05),
    "EDC5": (-18.47, -16.6, -14.45, -12.2, -10.88, -9.48, -8.0, -6.43, -4.79),
    "EIP": (-16.53, -15.76, -14.68, -13.7, -12.77, -11.84, -10.94, -10.11, -9.38),
    "EDM": (-15.63, -14.27, -12.78, -11.17, -9.47, -7.69, -5.85, -3.95, -2.03),
    "EPL": (-15.31, -15.21, -14.8, -14.18, -13.41, -12.5, -11.48, -10.36, -9.15),
    "EPB": (-3.73, -3.1, -2.43, -1.74, -1.03, -0.31, 0.42, 1.14, 1.84),
    "APL": (1.85, 3.18, 4.46, 5.67, 6.81, 7.84, 8.75, 9.5, 10.06),
    "FCR": (14.93, 16.21, 17.25, 18.02, 18.46, 18.6, 18.57, 17.75, 14.67),
    "FCU": (13.11, 14.65, 16.06, 17.32, 18.41, 19.31, 19.94, 20.22, 19.85),
    "PL": (17.73, 19.89, 21.86, 23.61, 25.11, 26.28, 27.04, 27.18, 26.32),
    "ECRL": (-11.19, -12.1, -12.27, -12.07, -11.66, -11.08, -10.38, -9.56, -8.64),
    "ECRB": (-17.94, -17.45, -16.89, -16.19, -15.33, -14.32, -13.17, -11.91, -10.53),
    "ECU": (-9.55, -9.55, -9.12, -8.4, -7.55, -6.67, -5.77, -4.85, -3.87),
}
# Published polynomials of the angle [cm], read on a page of the Bulgarian Academy of Sciences (EPL's is cut off after the cube).
PUBLISHED = {
    "PL": (2.17, 0.91, -0.31, -0.26, 0.07, 0.04), "FDS": (1.48, 1.149, 0.31, -0.86, -0.15, 0.25),
    "FDP": (1.31, 0.97, 0.41, -0.72, -0.19, 0.23), "ECRB": (-1.37, 0.18, 0.21, -0.11, -0.08, 0.04),
    "FCR": (1.77, -0.081, -0.24, 0.05, 0.07, -0.02), "APL": (0.7, 0.39, 0.008, -0.14, -0.03, -0.04),
    "EPB": (0.35, 0.09, 0.05, -0.07, -0.02, 0.02), "ECRL": (-1.02, 0.31, 0.12, -0.12, -0.03, 0.03),
    "ECU": (-0.57, 0.28, 0.04, -0.14, -0.02, 0.03), "EPL": (-0.75, -0.039, 0.043, 0.003)}
FCU_SHARE = 14.5 / 18.46  # the mean with the arm of a dissection (Mirakhorlo 2016), over MyoHand's at 0 deg
FPL_AT_ZERO = 13.2  # [mm], mean of MyoHand and its polynomial; it grows like the deep finger flexors beside it in the tunnel


def arm_slope(muscle, first):
    """Between two angles next to each other [mm/deg]."""
    return (MYOHAND[muscle][first + 1] - MYOHAND[muscle][first]) / (MEASURED[1] - MEASURED[0])


def target(muscle, degrees):
    """Arms that the sources give at angles [mm]."""
    inner = np.clip(degrees, MEASURED[0], MEASURED[-1])
    arm = np.interp(inner, MEASURED, MYOHAND[muscle])
    rows = [PUBLISHED[name] for name in (muscle, muscle[:3]) if name in PUBLISHED]
    if muscle == "FCU":  # in no tunnel: on along its last slopes
        ends = np.where(degrees < 0, arm_slope(muscle, 0), arm_slope(muscle, -2))
        return FCU_SHARE * (arm + ends * (degrees - inner))
    if not rows:
        return arm

    def published(angles):
        return 10 * np.polynomial.polynomial.polyval(np.radians(angles), rows[0])

    return 0.5 * (arm + published(inner)) + published(degrees) - published(inner)


def fit(muscle):
    """Coefficients [m], [m/rad], ..."""
    degrees = np.arange(RANGE[0], RANGE[1] + 1, 5.0)
    if muscle == "FPL":
        grown = np.mean([fit(f"FDP{finger}") for finger in (2, 3, 4, 5)], axis=0)
        return np.concatenate([[1e-3 * FPL_AT_ZERO], grown[1:]])
    return 1e-3 * np.polynomial.polynomial.polyfit(np.radians(degrees), target(muscle, degrees), DEGREE)


def main():
    for muscle in [*MYOHAND, "FPL"]:
        print(f"{muscle}: wrist.flexion: [{', '.join(f'{each + 0:.6f}' for each in fit(muscle))}]")


if __name__ == "__main__":
    main()
