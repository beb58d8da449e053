// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "ancestors.hpp"

#include <algorithm>

namespace grid_slam {

namespace {

/// Particles from 0 on in the order of the tree, and every other ancestor in the middle of its children.
void place(std::vector<Ancestor>& all) {
  std::vector<std::vector<std::size_t>> children(all.size());
  std::vector<std::size_t> open;  // still to be visited, the next at the end
  for (std::size_t i = all.size(); i-- > 0;)
    if (all[i].parent)
      children[*all[i].parent].push_back(i);
    else
      open.push_back(i);
  double next = 0;
  while (!open.empty()) {
    const std::size_t at = open.back();
    open.pop_back();
    if (all[at].particles > 0) all[at].place = next++;
    open.insert(open.end(), children[at].begin(), children[at].end());
  }
  for (std::size_t i = all.size(); i-- > 0;)
    if (all[i].particles == 0)
      all[i].place = 0.5 * (all[children[i].front()].place + all[children[i].back()].place);
}

}  // namespace

std::vector<Ancestor> ancestors_of(const cairn::PathsRecord<cairn::SE2>& record) {
  const std::size_t count = record.nodes.size();
  std::vector<std::size_t> children(count), particles(count);
  std::size_t begins = 0;
  for (const auto& node : record.nodes) ++(node.parent < count ? children[node.parent] : begins);
  for (const auto& particle : record.particles) ++particles[particle.node];
  std::vector<Ancestor> all;
  if (begins > 1) all.emplace_back();
  const std::optional<std::size_t> first = begins > 1 ? std::optional<std::size_t>(0) : std::nullopt;
  std::vector<std::optional<std::size_t>> last(count);  // ancestor that ends at a pose or before it
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t parent = record.nodes[i].parent;
    last[i] = parent < count ? last[parent] : first;
    if (children[i] == 1 && particles[i] == 0) continue;  // the path goes on
    const std::uint64_t born = last[i] ? all[*last[i]].end : 0;
    all.push_back({last[i], born, record.nodes[i].pose.step, 0, particles[i]});
    last[i] = all.size() - 1;
  }
  place(all);
  return all;
}

}  // namespace grid_slam
