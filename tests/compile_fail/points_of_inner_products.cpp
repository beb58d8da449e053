// words: cairn: a point; [axis]; Through
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <vector>

#include <cairn/index/inner_product.hpp>

struct Foreign {
  double x, y, z;
};

std::size_t lifted(const std::vector<Foreign>& points) {
  return cairn::InnerProductPoints(points).size();
}
