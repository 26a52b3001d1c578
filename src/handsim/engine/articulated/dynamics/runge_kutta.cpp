#include "handsim/engine/articulated/dynamics/runge_kutta.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace handsim::engine::articulated {

namespace {

constexpr std::size_t kStages = 12;

/// Row i: weights of the slopes before stage i.
constexpr std::array<std::array<double, kStages>, kStages> kA = {
    {{},
     {5.26001519587677318785587544488e-2},
     {1.97250569845378994544595329183e-2, 5.91751709536136983633785987549e-2},
     {2.95875854768068491816892993775e-2, 0, 8.87627564304205475450678981324e-2},
     {2.41365134159266685502369798665e-1, 0, -8.84549479328286085344864962717e-1,
      9.24834003261792003115737966543e-1},
     {3.7037037037037037037037037037e-2, 0, 0, 1.70828608729473871279604482173e-1,
      1.25467687566822425016691814123e-1},
     {3.7109375e-2, 0, 0, 1.70252211019544039314978060272e-1, 6.02165389804559606850219397283e-2,
      -1.7578125e-2},
     {3.70920001185047927108779319836e-2, 0, 0, 1.70383925712239993810214054705e-1,
      1.07262030446373284651809199168e-1, -1.53194377486244017527936158236e-2,
      8.27378916381402288758473766002e-3},
     {6.24110958716075717114429577812e-1, 0, 0, -3.36089262944694129406857109825,
      -8.68219346841726006818189891453e-1, 2.75920996994467083049415600797e1,
      2.01540675504778934086186788979e1, -4.34898841810699588477366255144e1},
     {4.77662536438264365890433908527e-1, 0, 0, -2.48811461997166764192642586468,
      -5.90290826836842996371446475743e-1, 2.12300514481811942347288949897e1,
      1.52792336328824235832596922938e1, -3.32882109689848629194453265587e1,
      -2.03312017085086261358222928593e-2},
     {-9.3714243008598732571704021658e-1, 0, 0, 5.18637242884406370830023853209,
      1.09143734899672957818500254654, -8.14978701074692612513997267357, -1.85200656599969598641566180701e1,
      2.27394870993505042818970056734e1, 2.49360555267965238987089396762, -3.0467644718982195003823669022},
     {2.27331014751653820792359768449, 0, 0, -1.05344954667372501984066689879e1,
      -2.00087205822486249909675718444, -1.79589318631187989172765950534e1, 2.79488845294199600508499808837e1,
      -2.85899827713502369474065508674, -8.87285693353062954433549289258, 1.23605671757943030647266201528e1,
      6.43392746015763530355970484046e-1}}};

/// Times of the stages; weights of order 8 and, of the stages, the difference to those of order 5.
constexpr std::array<std::array<double, kStages>, 3> kRows = {
    {{0.0, 0.526001519587677318785587544488e-01, 0.789002279381515978178381316732e-01,
      0.118350341907227396726757197510, 0.281649658092772603273242802490, 1.0 / 3, 0.25, 4.0 / 13,
      0.651282051282051282051282051282, 0.6, 6.0 / 7, 1.0},
     {5.42937341165687622380535766363e-2, 0, 0, 0, 0, 4.45031289275240888144113950566,
      1.89151789931450038304281599044, -5.8012039600105847814672114227, 3.1116436695781989440891606237e-1,
      -1.52160949662516078556178806805e-1, 2.01365400804030348374776537501e-1,
      4.47106157277725905176885569043e-2},
     {0.1312004499419488073250102996e-1, 0, 0, 0, 0, -0.1225156446376204440720569753e1,
      -0.4957589496572501915214079952, 0.1664377182454986536961530415e1, -0.3503288487499736816886487290,
      0.3341791187130174790297318841, 0.8192320648511571246570742613e-1,
      -0.2235530786388629525884427845e-1}}};
constexpr const auto& kC = kRows[0];
constexpr const auto& kB = kRows[1];
constexpr const auto& kE5 = kRows[2];

/// Weights of order 3 at stages 0, 8 and 11.
constexpr double kThird0 = 0.244094488188976377952755905512, kThird8 = 0.733846688281611857341361741547,
                 kThird11 = 0.220588235294117647058823529412e-1;
constexpr double kSafety = 0.9, kLeast = 0.333, kMost = 6;

}  // namespace

RungeKutta::RungeKutta(std::size_t size, std::size_t weighed, Slope slope)
    : size_(size),
      weighed_(weighed),
      slope_(std::move(slope)),
      k_(kStages, std::vector<double>(size)),
      y_(size) {}

bool RungeKutta::evaluate(std::size_t stage, double t) { return slope_(t, y_, k_[stage]); }

bool RungeKutta::step4(double t, double h, std::span<double> y) {
  constexpr std::array<double, 4> kNode = {0, 0.5, 0.5, 1};
  for (std::size_t stage = 0; stage < 4; ++stage) {
    for (std::size_t i = 0; i < size_; ++i)
      y_[i] = stage == 0 ? y[i] : y[i] + kNode[stage] * h * k_[stage - 1][i];
    if (!evaluate(stage, t + kNode[stage] * h)) return false;
  }
  for (std::size_t i = 0; i < size_; ++i) y[i] += h / 6 * (k_[0][i] + 2 * (k_[1][i] + k_[2][i]) + k_[3][i]);
  return true;
}

double RungeKutta::try_step8(double t, double h, std::span<const double> y, double tolerance,
                             std::span<double> out) {
  for (std::size_t stage = 0; stage < kStages; ++stage) {
    if (stage == 0 && has_start_) continue;
    std::ranges::copy(y, y_.begin());
    for (std::size_t j = 0; j < stage; ++j) {
      const double weight = h * kA[stage][j];
      if (weight == 0) continue;
      for (std::size_t i = 0; i < size_; ++i) y_[i] += weight * k_[j][i];
    }
    if (!evaluate(stage, t + kC[stage] * h)) return -1;
  }
  has_start_ = true;
  double fifth = 0, third = 0;
  for (std::size_t i = 0; i < size_; ++i) {
    double sum = 0, error = 0;
    for (std::size_t j = 0; j < kStages; ++j) {
      sum += kB[j] * k_[j][i];
      error += kE5[j] * k_[j][i];
    }
    out[i] = y[i] + h * sum;
    const double scale = tolerance * (1 + std::max(std::abs(y[i]), std::abs(out[i])));
    const double low = sum - kThird0 * k_[0][i] - kThird8 * k_[8][i] - kThird11 * k_[11][i];
    fifth += (error / scale) * (error / scale);
    third += (low / scale) * (low / scale);
  }
  const double both = fifth + 0.01 * third;
  return both > 0 ? std::abs(h) * fifth / std::sqrt(both * static_cast<double>(weighed_)) : 0;
}

double step_factor8(double error) {
  return error > 0 ? std::clamp(kSafety * std::pow(error, -1.0 / 8), kLeast, kMost) : kMost;
}

}  // namespace handsim::engine::articulated
