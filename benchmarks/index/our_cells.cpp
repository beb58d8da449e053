// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <memory>
#include <optional>
#include <span>

#include <cairn/index/collectors.hpp>
#include <cairn/index/descriptor_index.hpp>
#include <cairn/index/points.hpp>

#include "rivals.hpp"

namespace cairn_bench {

std::unique_ptr<DescriptorRival> make_our_cells(std::size_t dim, bool with_codes) {
  using Index = cairn::DescriptorIndex<cairn::Rows<float>>;
  struct Held {
    std::optional<cairn::Rows<float>> rows;
    std::optional<Index> index;
  };
  auto held = std::make_shared<Held>();
  return std::make_unique<DescriptorRival>(DescriptorRival{
      with_codes ? "cells" : "cells without codes",
      [held, dim, with_codes](const float* rows, std::size_t count) {
        held->rows.emplace(std::span(rows, count * dim), dim);
        held->index.emplace(
            *held->rows, cairn::DescriptorIndexOptions{.codes = with_codes ? cairn::DescriptorCodes::automatic
                                                                           : cairn::DescriptorCodes::off});
      },
      [held, dim](const std::vector<float>& queries, int leaves) {
        const cairn::Rows<float> asked(queries, dim);
        std::vector<TwoNearest> found(asked.size());
        Index::Search search;
        for (std::size_t i = 0; i < found.size(); ++i) {
          cairn::NearestTwo<float> two;
          search.search(*held->index, asked[i], two, {.leaves = static_cast<std::size_t>(leaves)});
          found[i] = {two.id(), two.first(), two.second()};
        }
        return found;
      },
      [held] { return held->index->bytes(); }});
}

}  // namespace cairn_bench
