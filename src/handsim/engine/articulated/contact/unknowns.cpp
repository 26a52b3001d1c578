#include "handsim/engine/articulated/contact/unknowns.h"

#include <algorithm>
#include <numeric>

namespace handsim::engine::articulated {

void Unknowns::reserve(std::size_t n) {
  reserve_each(n, ids, first, last, parent, row_start, chains, trees, chain_of, tree_of);
}

void Unknowns::assign(std::span<const int> first_of) {
  first.assign(first_of.begin(), first_of.end());
  ids.resize(first.size());
  std::iota(ids.begin(), ids.end(), 0);
  lay_out();
}

bool Unknowns::choose(const Unknowns& from, std::span<const int> chosen) {
  const auto same = [&](int i, int id) { return from.ids[as_index(i)] == id; };
  if (std::equal(chosen.begin(), chosen.end(), ids.begin(), ids.end(), same)) return false;
  ids.clear();
  first.clear();
  for (const int i : chosen) {
    // A tree's unknowns stay together.
    first.push_back(static_cast<int>(ids.size()) - (i - from.first[as_index(i)]));
    ids.push_back(from.ids[as_index(i)]);
  }
  lay_out();
  return true;
}

std::size_t Unknowns::widest() const {
  std::size_t deepest = 0;
  for (int i = 0; i < size(); ++i) {
    std::size_t depth = 0;
    for (int k = i; k < size(); k = parent[as_index(k)]) ++depth;
    deepest = std::max(deepest, depth);
  }
  return std::min(first.size(), 2 * deepest);
}

std::size_t place_rows(std::span<const int> last, std::vector<std::size_t>& row_start) {
  row_start.resize(last.size());
  std::size_t count = 0;
  for (std::size_t i = 0; i < last.size(); ++i) {
    row_start[i] = count - i;  // entry (i, j) is at row_start + j
    count += as_index(last[i]) - i + 1;
  }
  return count;
}

void Unknowns::lay_out() {
  const int n = size();
  last.resize(as_index(n));
  parent.assign(as_index(n), n);
  for (int k = 0; k < n; ++k) last[as_index(k)] = k;
  for (int k = n - 1; k >= 0; --k)
    for (int i = first[as_index(k)]; i < k; ++i) {
      last[as_index(i)] = std::max(last[as_index(i)], k);
      parent[as_index(i)] = k;
    }
  entries = place_rows(last, row_start);
  chains.clear();
  trees.clear();
  chain_of.resize(as_index(n));
  tree_of.resize(as_index(n));
  for (int i = 0; i < n; ++i) {
    const bool goes_on =
        i > 0 && parent[as_index(i - 1)] == i && first[as_index(i - 1)] == first[as_index(i)];
    if (!goes_on) chains.push_back({i, i});
    if (i == 0 || parent[as_index(i - 1)] == n) trees.push_back({i, i});
    chains.back().end = trees.back().end = i + 1;
    chain_of[as_index(i)] = chains.size() - 1;
    tree_of[as_index(i)] = static_cast<int>(trees.size()) - 1;
  }
}

}  // namespace handsim::engine::articulated
