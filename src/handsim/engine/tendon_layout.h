// Which tendon stands in which lane (tendon_lanes.h). Tendons whose coordinates begin one list (a finger's)
// form a chain; chains of equal length stand side by side and share sums; a lone one takes all lanes.
#pragma once

#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "handsim/engine/tendon_lanes.h"

namespace handsim::engine {

class TendonLayout {
 public:
  /// Says whether an engine solves the entry of B of two coordinates, or has its bound on the diagonal.
  using Solves = std::function<bool(int, int)>;
  TendonLayout(std::span<const model::Muscle> muscles, std::span<const model::Band> bands,
               const Solves& solves);
  TendonLayout(const TendonLayout&) = delete;  ///< arrays() points into it
  TendonLayout& operator=(const TendonLayout&) = delete;

  const TendonArrays& arrays() const { return arrays_; }
  /// Block and lane of a muscle.
  struct Place {
    int block = 0, lane = 0;
  };
  std::span<const Place> muscles() const { return muscles_; }
  std::span<const Place> bands() const { return bands_; }
  /// The coordinate rows of each pair's sum.
  const std::pair<int, int>& pair(std::size_t sum) const { return sums_of_[sum]; }

 private:
  struct Tendon {
    const model::TendonPath* path = nullptr;
    const model::Muscle* muscle = nullptr;
    const model::Band* band = nullptr;
    int index = 0;  ///< in the model
    int chain = 0;
  };
  /// Coordinates, of one chain a lane.
  using Dofs = std::vector<int>;
  using Family = std::array<Dofs, kTendonLanes>;

  void add_tendons(std::vector<Tendon> tendons, const Solves& solves);
  void add_family(const Family& family, std::vector<std::vector<Tendon>> lanes, const Solves& solves);
  void add_block(const Family& family, const std::array<Tendon, kTendonLanes>& row, const Solves& solves);
  void add_arms(TendonBlock& block, const Family& family, const std::array<Tendon, kTendonLanes>& row);
  void add_pairs(TendonBlock& block, const Family& family, const Solves& solves);
  int coordinate(const Family& family, std::size_t i);

  std::vector<TendonBlock> blocks_;
  std::vector<CoordinateRow> coordinates_;
  std::vector<ArmRow> arms_;
  std::vector<ProductRow> products_;
  std::vector<int> pairs_;
  std::vector<PairRow> sums_;
  std::vector<std::pair<int, int>> sums_of_;
  std::vector<ElasticRow> elastic_;
  std::vector<BridgeRow> bridges_;
  std::vector<Place> muscles_, bands_;
  TendonArrays arrays_;
};

}  // namespace handsim::engine
