// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <Eigen/Core>

int main() {
  return Eigen::Matrix2d::Identity()(0, 1) > 0 ? 1 : 0;
}
