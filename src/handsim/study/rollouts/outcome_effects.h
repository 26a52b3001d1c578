// What the rows of a table say of an outcome, and what each varied key does to it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "handsim/study/rollouts/rollout_table.h"
#include "handsim/study/statistics.h"

namespace handsim::study {

/// The outcome at one value of a key, or in a range of its values.
struct Bin {
  std::string label;                     ///< of a text
  double low = 0, middle = 0, high = 0;  ///< of the values in it
  std::vector<double> outcomes;
  std::optional<Estimate> estimate;  ///< share or mean
};

/// What one varied column does to an outcome.
struct KeyEffect {
  std::string name;
  bool text = false;
  std::optional<Estimate> correlation;  ///< of numbers
  std::vector<Bin> bins;

  /// A bin for each value, not for ranges of them.
  bool levels() const;
  /// The bins that tell the effect: all levels; of ranges both ends, and between them one that is above or
  /// below both beyond their intervals.
  std::vector<const Bin*> telling() const;
};

/// An outcome over all rows that have it.
struct OutcomeEffects {
  std::string name;
  bool verdict = false;  ///< 0 or 1: shares, where others have means
  std::vector<double> values;
  std::optional<Estimate> all;  ///< share or mean
  std::vector<KeyEffect> keys;
  std::vector<VarianceShare> variance;

  bool varies() const { return all && (verdict || all->low < all->high); }
};

/// Effects on the outcome in a column of the table.
OutcomeEffects effects_on(const Table& table, std::size_t outcome);

/// `held` first, then the outcomes that the study names.
std::vector<OutcomeEffects> outcome_effects(const Table& table);

}  // namespace handsim::study
