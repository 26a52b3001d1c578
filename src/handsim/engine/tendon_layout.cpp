#include "handsim/engine/tendon_layout.h"

#include <algorithm>
#include <array>

#include "handsim/core/index.h"
#include "handsim/model/hill_lanes.h"

namespace handsim::engine {

namespace {

using Dofs = std::vector<int>;

bool starts(const Dofs& list, const Dofs& with) {
  return with.size() <= list.size() && std::equal(with.begin(), with.end(), list.begin());
}

bool same(const model::ArmProduct& a, const model::ArmProduct& b) {
  return a.a == b.a && a.b == b.b && a.power_a == b.power_a && a.power_b == b.power_b;
}

/// The chain of each list: the one list that it is the beginning of, or itself. Numbers into `chains`.
std::vector<int> chains_of(const std::vector<Dofs>& lists, std::vector<Dofs>& chains) {
  std::vector<Dofs> longest;
  for (const Dofs& list : lists) {
    if (std::ranges::any_of(longest, [&](const Dofs& each) { return starts(each, list); })) continue;
    std::erase_if(longest, [&](const Dofs& each) { return starts(list, each); });
    longest.push_back(list);
  }
  std::vector<int> out;
  for (const Dofs& list : lists) {
    const auto begins = [&](const Dofs& each) { return starts(each, list); };
    const bool one = !list.empty() && std::ranges::count_if(longest, begins) == 1;
    const Dofs& chain = one ? *std::ranges::find_if(longest, begins) : list;
    const auto found = std::ranges::find(chains, chain);
    out.push_back(static_cast<int>(found - chains.begin()));
    if (found == chains.end()) chains.push_back(chain);
  }
  return out;
}

/// Pair by pair.
std::vector<bool> solved_pairs(const Dofs& dofs, const TendonLayout::Solves& solves) {
  std::vector<bool> out;
  for (std::size_t i = 0; i < dofs.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) out.push_back(solves(dofs[i], dofs[j]));
  return out;
}

void fill(TendonLane& lanes, double value) { std::fill(std::begin(lanes), std::end(lanes), value); }

TendonBlock empty_block() {
  TendonBlock out{};
  for (TendonLane* each :
       {&out.length, &out.per_length, &out.reach, &out.least, &out.max_speed, &out.up, &out.down})
    fill(*each, 1);
  std::fill(std::begin(out.tendon), std::end(out.tendon), kNoTendon);
  return out;
}

void set_muscle(TendonBlock& block, std::size_t lane, const model::Muscle& muscle) {
  const model::HillConstants<double> hill = model::hill_constants(muscle);
  block.strength[lane] = hill.force;
  block.length[lane] = hill.length;
  block.per_length[lane] = hill.per_length;
  block.height[lane] = hill.height;
  block.reach[lane] = hill.reach;
  block.least[lane] = hill.least;
  block.max_speed[lane] = hill.max_speed;
  block.drag[lane] = hill.drag;
  block.up[lane] = muscle.activation_time;
  block.down[lane] = muscle.deactivation_time;
  block.excitable[lane] = muscle.excitable;
}

void set_band(TendonBlock& block, std::size_t lane, const model::Band& band) {
  block.stiffness[lane] = band.stiffness;
  block.damping[lane] = band.damping;
  block.rest[lane] = band.rest;
  block.one_way[lane] = band.both_ways ? 0 : 1;
}

}  // namespace

TendonLayout::TendonLayout(std::span<const model::Muscle> muscles, std::span<const model::Band> bands,
                           const Solves& solves)
    : muscles_(muscles.size()), bands_(bands.size()) {
  std::vector<Tendon> tendons;
  for (const bool bridged : {false, true})
    for (const bool elastic : {false, true}) {
      for (std::size_t i = 0; i < muscles.size(); ++i)
        if (muscles[i].tendon_strain.has_value() == elastic && muscles[i].short_range.has_value() == bridged)
          tendons.push_back({&muscles[i].path, &muscles[i], nullptr, static_cast<int>(i), 0});
      add_tendons(std::move(tendons), solves);
      tendons.clear();
    }
  for (std::size_t i = 0; i < bands.size(); ++i)
    tendons.push_back({&bands[i].path, nullptr, &bands[i], static_cast<int>(i), 0});
  add_tendons(std::move(tendons), solves);
  arrays_ = {static_cast<int>(blocks_.size()),
             static_cast<int>(coordinates_.size()),
             static_cast<int>(sums_.size()),
             blocks_.data(),
             coordinates_.data(),
             arms_.data(),
             products_.data(),
             pairs_.data(),
             sums_.data(),
             elastic_.data(),
             bridges_.data()};
}

void TendonLayout::add_tendons(std::vector<Tendon> tendons, const Solves& solves) {
  std::vector<Dofs> lists, chains;
  for (const Tendon& each : tendons) {
    Dofs& dofs = lists.emplace_back();
    for (const model::MomentArm& arm : each.path->arms) dofs.push_back(arm.dof);
  }
  const std::vector<int> chain_of = chains_of(lists, chains);
  for (std::size_t i = 0; i < tendons.size(); ++i) tendons[i].chain = chain_of[i];
  std::vector<bool> placed(chains.size(), false);
  for (std::size_t first = 0; first < chains.size(); ++first) {
    if (placed[first]) continue;
    std::vector<std::size_t> side_by_side;
    for (std::size_t c = first; c < chains.size() && side_by_side.size() < kTendonLanes; ++c)
      if (!placed[c] && chains[c].size() == chains[first].size() &&
          solved_pairs(chains[c], solves) == solved_pairs(chains[first], solves))
        side_by_side.push_back(c);
    Family family;
    std::vector<std::vector<Tendon>> lanes(kTendonLanes);
    const std::size_t count = side_by_side.size();
    for (std::size_t k = 0; k < kTendonLanes; ++k) family[k] = chains[side_by_side[k % count]];
    for (std::size_t k = 0; k < count; ++k) {
      placed[side_by_side[k]] = true;
      std::size_t lane = k;
      for (const Tendon& each : tendons) {
        if (each.chain != static_cast<int>(side_by_side[k])) continue;
        lanes[lane].push_back(each);
        lane = lane + count < kTendonLanes ? lane + count : k;
      }
    }
    add_family(family, std::move(lanes), solves);
  }
}

/// Blocks of tendons of one sort, with the most arms first.
void TendonLayout::add_family(const Family& family, std::vector<std::vector<Tendon>> lanes,
                              const Solves& solves) {
  for (std::vector<Tendon>& lane : lanes)
    std::ranges::stable_sort(
        lane, [](const Tendon& a, const Tendon& b) { return a.path->arms.size() > b.path->arms.size(); });
  while (true) {
    const auto open = std::ranges::find_if(lanes, [](const auto& lane) { return !lane.empty(); });
    if (open == lanes.end()) return;
    const Tendon sort = open->front();
    std::array<Tendon, kTendonLanes> row;
    for (std::size_t k = 0; k < lanes.size(); ++k) {
      const auto next = std::ranges::find_if(lanes[k], [&](const Tendon& each) {
        return std::ranges::equal(each.path->products, sort.path->products, same);
      });
      if (next == lanes[k].end()) continue;
      row[k] = *next;
      lanes[k].erase(next);
    }
    add_block(family, row, solves);
  }
}

void TendonLayout::add_block(const Family& family, const std::array<Tendon, kTendonLanes>& row,
                             const Solves& solves) {
  TendonBlock& block = blocks_.emplace_back(empty_block());
  block.elastic = block.bridges = kRigid;
  for (std::size_t k = 0; k < row.size(); ++k) {
    const Tendon& tendon = row[k];
    if (!tendon.path) continue;
    const Place place = {static_cast<int>(blocks_.size()) - 1, static_cast<int>(k)};
    block.tendon[k] = tendon.index;
    block.arms = std::max(block.arms, static_cast<int>(tendon.path->arms.size()));
    if (tendon.muscle) {
      block.muscles = true;
      set_muscle(block, k, *tendon.muscle);
      if (tendon.muscle->tendon_strain) {
        if (block.elastic == kRigid) {
          block.elastic = static_cast<int>(elastic_.size());
          ElasticRow& empty = elastic_.emplace_back();
          for (TendonLane* each : {&empty.per_stretch, &empty.fibre, &empty.reach}) fill(*each, 1);
        }
        elastic_.back().per_stretch[k] = model::per_stretch(*tendon.muscle);
      }
      if (tendon.muscle->short_range) {
        if (block.bridges == kRigid) {
          block.bridges = static_cast<int>(bridges_.size());
          fill(bridges_.emplace_back().softness, 1);
        }
        bridges_.back().softness[k] = 1 / *tendon.muscle->short_range;
      }
      muscles_[as_index(tendon.index)] = place;
    } else {
      set_band(block, k, *tendon.band);
      bands_[as_index(tendon.index)] = place;
    }
  }
  add_arms(block, family, row);
  add_pairs(block, family, solves);
}

void TendonLayout::add_arms(TendonBlock& block, const Family& family,
                            const std::array<Tendon, kTendonLanes>& row) {
  block.first_arm = static_cast<int>(arms_.size());
  block.first_product = static_cast<int>(products_.size());
  for (std::size_t i = 0; i < as_index(block.arms); ++i) {
    ArmRow& out = arms_.emplace_back();
    out = {};
    out.coordinate = coordinate(family, i);
    for (std::size_t k = 0; k < row.size(); ++k) {
      if (!row[k].path || i >= row[k].path->arms.size()) continue;
      const model::MomentArm& arm = row[k].path->arms[i];
      out.low[k] = arm.low;
      out.high[k] = arm.high;
      for (std::size_t t = 0; t < arm.c.size(); ++t) {
        out.c[t][k] = arm.c[t];
        out.integral[t][k] = arm.c[t] * (1.0 / static_cast<double>(t + 1));
        if (arm.c[t] != 0) out.terms = std::max(out.terms, static_cast<int>(t) + 1);
      }
    }
  }
  for (const Tendon& tendon : row) {
    if (!tendon.path) continue;
    for (const model::ArmProduct& each : tendon.path->products) {
      ProductRow& out = products_.emplace_back();
      out = {{}, each.a, each.b, each.power_a, each.power_b};
      for (std::size_t k = 0; k < row.size(); ++k)
        if (row[k].path) out.factor[k] = row[k].path->products[as_index(block.products)].factor;
      ++block.products;
    }
    return;
  }
}

void TendonLayout::add_pairs(TendonBlock& block, const Family& family, const Solves& solves) {
  block.first_pair = static_cast<int>(pairs_.size());
  for (std::size_t i = 0; i < as_index(block.arms); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      int& out = pairs_.emplace_back(kBounded);
      if (!solves(family[0][i], family[0][j])) continue;
      const int a = coordinate(family, i), b = coordinate(family, j);
      const std::pair<int, int> rows = std::minmax(a, b);
      const auto found = std::ranges::find(sums_of_, rows);
      out = static_cast<int>(found - sums_of_.begin());
      if (found != sums_of_.end()) continue;
      sums_of_.push_back(rows);
      sums_.push_back({});
    }
}

/// The row of the i-th coordinate of each lane.
int TendonLayout::coordinate(const Family& family, std::size_t i) {
  CoordinateRow row{};
  for (std::size_t k = 0; k < family.size(); ++k) row.dof[k] = family[k][i];
  for (std::size_t c = 0; c < coordinates_.size(); ++c)
    if (std::equal(std::begin(row.dof), std::end(row.dof), coordinates_[c].dof)) return static_cast<int>(c);
  coordinates_.push_back(row);
  return static_cast<int>(coordinates_.size()) - 1;
}

}  // namespace handsim::engine
