// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The oracle of a growing state: the same in the plainest way. One dense covariance of long double, every
/// operation the textbook's formula over all numbers, in loops of its own.
#pragma once

#include <cmath>
#include <cstddef>
#include <utility>
#include <variant>
#include <vector>

#include <cairn/core/linalg.hpp>
#include <cairn/manifold/manifold.hpp>
#include <cairn/manifold/se2.hpp>

namespace cairn_test {

using Real = long double;

struct Dense {
  int rows = 0, columns = 0;
  std::vector<Real> numbers;

  Dense() = default;
  Dense(int r, int c)
      : rows(r), columns(c), numbers(static_cast<std::size_t>(r) * static_cast<std::size_t>(c)) {}
  template <class A>
  explicit Dense(const A& a) : Dense(static_cast<int>(a.rows()), static_cast<int>(a.cols())) {
    for (int i = 0; i < rows; ++i)
      for (int j = 0; j < columns; ++j) (*this)(i, j) = static_cast<Real>(a(i, j));
  }
  static Dense identity(int n) {
    Dense one(n, n);
    for (int i = 0; i < n; ++i) one(i, i) = 1;
    return one;
  }
  Real& operator()(int i, int j) { return numbers[static_cast<std::size_t>(i * columns + j)]; }
  const Real& operator()(int i, int j) const { return numbers[static_cast<std::size_t>(i * columns + j)]; }

  [[nodiscard]] Dense transposed() const {
    Dense t(columns, rows);
    for (int i = 0; i < rows; ++i)
      for (int j = 0; j < columns; ++j) t(j, i) = (*this)(i, j);
    return t;
  }
  /// Gauss and Jordan, rows exchanged.
  [[nodiscard]] Dense inverse() const {
    Dense a = *this, b = identity(rows);
    for (int k = 0; k < rows; ++k) {
      int best = k;
      for (int i = k; i < rows; ++i)
        if (std::abs(a(i, k)) > std::abs(a(best, k))) best = i;
      for (int j = 0; j < rows; ++j) {
        std::swap(a(k, j), a(best, j));
        std::swap(b(k, j), b(best, j));
      }
      const Real pivot = a(k, k);
      for (int j = 0; j < rows; ++j) {
        a(k, j) /= pivot;
        b(k, j) /= pivot;
      }
      for (int i = 0; i < rows; ++i)
        if (const Real factor = a(i, k); i != k && factor != 0)
          for (int j = 0; j < rows; ++j) {
            a(i, j) -= factor * a(k, j);
            b(i, j) -= factor * b(k, j);
          }
    }
    return b;
  }
  friend Dense operator*(const Dense& a, const Dense& b) {
    Dense c(a.rows, b.columns);
    for (int i = 0; i < a.rows; ++i)
      for (int k = 0; k < a.columns; ++k)
        if (a(i, k) != 0)
          for (int j = 0; j < b.columns; ++j) c(i, j) += a(i, k) * b(k, j);
    return c;
  }
  friend Dense operator+(Dense a, const Dense& b) {
    for (std::size_t i = 0; i < a.numbers.size(); ++i) a.numbers[i] += b.numbers[i];
    return a;
  }
  friend Dense operator-(Dense a, const Dense& b) {
    for (std::size_t i = 0; i < a.numbers.size(); ++i) a.numbers[i] -= b.numbers[i];
    return a;
  }
};

class DenseJoint {
public:
  using Mean = std::variant<cairn::SE2, cairn::Vector<2>, cairn::Vector<1>>;
  struct Block {
    Mean mean;
    bool considered = false;
  };
  std::vector<Block> blocks;
  Dense p;

  static int dof(const Mean& mean) { return mean.index() == 0 ? 3 : mean.index() == 1 ? 2 : 1; }
  [[nodiscard]] int offset(int block) const {
    int sum = 0;
    for (int i = 0; i < block; ++i) sum += dof(blocks[static_cast<std::size_t>(i)].mean);
    return sum;
  }
  [[nodiscard]] int size() const { return p.rows; }

  /// Columns of parts of a Jacobian into those of all numbers.
  [[nodiscard]] Dense spread(const Dense& jacobian, const std::vector<int>& named) const {
    Dense all(jacobian.rows, size());
    int column = 0;
    for (const int block : named)
      for (int k = 0; k < dof(blocks[static_cast<std::size_t>(block)].mean); ++k, ++column)
        for (int i = 0; i < jacobian.rows; ++i) all(i, offset(block) + k) += jacobian(i, column);
    return all;
  }

  void extend(const Mean& mean, const Dense& g, const Dense& q) {
    const Dense cross = g * p;
    const Dense corner = cross * g.transposed() + q;
    Dense next(size() + q.rows, size() + q.rows);
    for (int i = 0; i < next.rows; ++i)
      for (int j = 0; j < next.rows; ++j)
        next(i, j) = i < size() && j < size()     ? p(i, j)
                     : i >= size() && j >= size() ? corner(i - size(), j - size())
                     : i >= size()                ? cross(i - size(), j)
                                                  : cross(j - size(), i);
    p = next;
    blocks.push_back({mean, false});
  }

  /// P <- F P F^T + Q with F = 1 but for the named blocks.
  void transform(const Dense& f, const Dense& q, const std::vector<int>& named) {
    Dense all = Dense::identity(size()), noise(size(), size());
    int row = 0;
    for (const int a : named)
      for (int i = 0; i < dof(blocks[static_cast<std::size_t>(a)].mean); ++i, ++row) {
        all(offset(a) + i, offset(a) + i) = 0;
        int column = 0;
        for (const int b : named)
          for (int j = 0; j < dof(blocks[static_cast<std::size_t>(b)].mean); ++j, ++column) {
            all(offset(a) + i, offset(b) + j) = f(row, column);
            noise(offset(a) + i, offset(b) + j) = q(row, column);
          }
      }
    p = all * p * all.transposed() + noise;
  }

  [[nodiscard]] std::vector<bool> considered_rows() const {
    std::vector<bool> rows;
    for (const Block& block : blocks)
      rows.insert(rows.end(), static_cast<std::size_t>(dof(block.mean)), block.considered);
    return rows;
  }
  void move(const Dense& step) {
    int row = 0;
    for (Block& block : blocks) {
      std::visit(
          [&]<class X>(X& mean) {
            cairn::Tangent<X> d;
            for (int k = 0; k < cairn::dof<X>; ++k) d(k) = static_cast<double>(step(row + k, 0));
            mean = cairn::retract(mean, d);
            row += cairn::dof<X>;
          },
          block.mean);
    }
  }

  /// Joseph's form with the gain of considered rows struck out.
  void update(const Dense& h, const Dense& r, const Dense& residual) {
    const Dense ph = p * h.transposed();
    Dense k = ph * (h * ph + r).inverse();
    const std::vector<bool> considered = considered_rows();
    for (int i = 0; i < size(); ++i)
      for (int j = 0; considered[static_cast<std::size_t>(i)] && j < k.columns; ++j) k(i, j) = 0;
    const Dense a = Dense::identity(size()) - k * h;
    p = a * p * a.transposed() + k * r * k.transposed();
    move(k * residual);
  }

  /// K (P_ss - S+) K^T off all; what is considered and not named stays.
  void commit(const std::vector<int>& named, const Dense& step, const Dense& posterior) {
    const int d = step.rows;
    Dense select = spread(Dense::identity(d), named);
    const Dense ps = p * select.transposed();
    const Dense pss = select * ps;
    const Dense k = ps * pss.inverse();
    const Dense next = p - k * (pss - posterior) * k.transposed();
    Dense all = k * step;
    std::vector<bool> stays = considered_rows();
    for (const int block : named)
      for (int i = 0; i < dof(blocks[static_cast<std::size_t>(block)].mean); ++i)
        stays[static_cast<std::size_t>(offset(block) + i)] = false;
    for (int i = 0; i < size(); ++i) {
      if (stays[static_cast<std::size_t>(i)]) all(i, 0) = 0;
      for (int j = 0; j < size(); ++j)
        if (!stays[static_cast<std::size_t>(i)] || !stays[static_cast<std::size_t>(j)]) p(i, j) = next(i, j);
    }
    move(all);
  }

  void reorder(const std::vector<int>& order) {
    Dense next(size(), size());
    std::vector<Block> moved;
    std::vector<int> from;
    for (const int block : order) {
      for (int k = 0; k < dof(blocks[static_cast<std::size_t>(block)].mean); ++k)
        from.push_back(offset(block) + k);
      moved.push_back(blocks[static_cast<std::size_t>(block)]);
    }
    const int kept = static_cast<int>(from.size());
    Dense q(kept, kept);
    for (int i = 0; i < kept; ++i)
      for (int j = 0; j < kept; ++j)
        q(i, j) = p(from[static_cast<std::size_t>(i)], from[static_cast<std::size_t>(j)]);
    p = q;
    blocks = moved;
  }
  /// All but one, in order.
  void remove(int block) {
    std::vector<int> order;
    for (int i = 0; i < static_cast<int>(blocks.size()); ++i)
      if (i != block) order.push_back(i);
    reorder(order);
  }
};

}  // namespace cairn_test
