// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Sliding sums of products by the fast Fourier transform: what a correlation search spends its time on.
///
/// A plane has lines by the hundred, all of one length, so four of them are transformed side by side, one a
/// lane: no number has to change its lane, whatever the length. Within a line it is the transform of mixed
/// radix that leaves its result in order (C. Temperton, "Self-sorting mixed-radix fast Fourier transforms",
/// J. Computational Physics 52(1), 1983).
#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <cstring>
#include <numbers>
#include <utility>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/simd/processor.hpp>
#include <cairn/simd/registers.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI { namespace detail {

/// A rectangle of numbers, row by row.
struct Plane {
  int columns = 0, rows = 0;
  std::vector<double> values;

  Plane() = default;
  Plane(int width, int height, double value = 0.0)
      : columns(width),
        rows(height),
        values(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), value) {}
  [[nodiscard]] double& operator()(int column, int row) noexcept { return values[index(column, row)]; }
  [[nodiscard]] double operator()(int column, int row) const noexcept { return values[index(column, row)]; }

private:
  [[nodiscard]] std::size_t index(int column, int row) const noexcept {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
           static_cast<std::size_t>(column);
  }
};

/// The smallest product of 2, 3 and 5 that is at least n and 1.
inline int fast_length(int n) noexcept {
  for (n = std::max(n, 1);; ++n) {
    int rest = n;
    for (const int factor : {2, 3, 5})
      while (rest % factor == 0) rest /= factor;
    if (rest == 1) return n;
  }
}

/// Four lines are transformed together, a lane each. In memory a number of them is eight: the four real
/// parts, then the four imaginary ones.
inline constexpr std::size_t fft_lines = 4, fft_number = 2 * fft_lines;
using FftLane = Lanes<double, fft_lines>;

/// A number of each of the four lines.
struct FftNumber {
  FftLane re, im;

  [[gnu::always_inline]] void load(const double* from) noexcept {
    std::memcpy(&re, from, sizeof re);
    std::memcpy(&im, from + fft_lines, sizeof im);
  }
  [[gnu::always_inline]] void store(double* to) const noexcept {
    std::memcpy(to, &re, sizeof re);
    std::memcpy(to + fft_lines, &im, sizeof im);
  }
};

/// The discrete Fourier transform of P numbers, in place: 4 and the primes of fast_length().
template <int P>
[[gnu::always_inline]] inline void short_transform(FftNumber (&a)[P]) noexcept {
  if constexpr (P == 2) {
    const FftNumber first = a[0];
    a[0] = {first.re + a[1].re, first.im + a[1].im};
    a[1] = {first.re - a[1].re, first.im - a[1].im};
  } else if constexpr (P == 4) {
    FftNumber even[2] = {a[0], a[2]}, odd[2] = {a[1], a[3]};
    short_transform(even);
    short_transform(odd);
    a[0] = {even[0].re + odd[0].re, even[0].im + odd[0].im};
    a[1] = {even[1].re + odd[1].im, even[1].im - odd[1].re};
    a[2] = {even[0].re - odd[0].re, even[0].im - odd[0].im};
    a[3] = {even[1].re - odd[1].im, even[1].im + odd[1].re};
  } else {
    // Of the terms k and P - k the cosines are the same and the sines opposite, for k = 1 ... P / 2.
    static_assert(P == 3 || P == 5);
    constexpr int half = P / 2;
    static constexpr double fifth[] = {1.0, 0.30901699437494742410, -0.80901699437494742410};
    static constexpr double sine_of_fifth[] = {0.0, 0.95105651629515357212, 0.58778525229247312917};
    static constexpr double third[] = {1.0, -0.5}, sine_of_third[] = {0.0, 0.86602540378443864676};
    const double* cosine = P == 3 ? third : fifth;
    const double* sine = P == 3 ? sine_of_third : sine_of_fifth;
    FftNumber sum[half], difference[half];
    const FftNumber first = a[0];
    each<half>([&](int k) CAIRN_INLINED {
      const FftNumber &x = a[k + 1], &y = a[P - 1 - k];
      sum[k] = {x.re + y.re, x.im + y.im};
      difference[k] = {x.re - y.re, x.im - y.im};
    });
    each<half>([&](int k) CAIRN_INLINED { a[0] = {a[0].re + sum[k].re, a[0].im + sum[k].im}; });
    each<half>([&](int j) CAIRN_INLINED {
      FftNumber even = first, odd = {};
      each<half>([&](int k) CAIRN_INLINED {
        const int turn = (j + 1) * (k + 1) % P;
        const double c = cosine[std::min(turn, P - turn)];
        const double s = turn <= half ? sine[turn] : -sine[P - turn];
        even = {even.re + c * sum[k].re, even.im + c * sum[k].im};
        odd = {odd.re + s * difference[k].re, odd.im + s * difference[k].im};
      });
      a[j + 1] = {even.re + odd.im, even.im - odd.re};
      a[P - 1 - j] = {even.re - odd.im, even.im + odd.re};
    });
  }
}

/// The discrete Fourier transform of four lines side by side, without a factor.
class LinesTransform {
public:
  /// `length` is one of fast_length().
  explicit LinesTransform(int length) : length_(static_cast<std::size_t>(length)), roots_(length_) {
    for (std::size_t k = 0; k <= length_ / 2; ++k) {
      const std::size_t turn = 8 * k, quarter = 2 * length_;
      const double c = cosine(turn), s = cosine(turn < quarter ? quarter - turn : turn - quarter);
      roots_[k] = {c, -s};
      if (k > 0) roots_[length_ - k] = {c, s};
    }
    for (int rest = length; rest > 1; rest /= radices_.back())
      for (const int radix : {4, 2, 3, 5})
        if (rest % radix == 0) {
          radices_.push_back(radix);
          break;
        }
  }

  /// Transforms `from`, with `beside` to work in; returns which of the two holds the result. Lines with their
  /// real and imaginary parts swapped are transformed back, swapped as well, without the factor 1 / length.
  [[nodiscard]] double* run(double* from, double* beside) const noexcept {
    return with_avx2_lanes([&]() CAIRN_INLINED {
      std::size_t stride = 1;
      for (const int radix : radices_) {
        switch (radix) {
          case 2:
            stage<2>(from, beside, stride);
            break;
          case 3:
            stage<3>(from, beside, stride);
            break;
          case 4:
            stage<4>(from, beside, stride);
            break;
          default:
            stage<5>(from, beside, stride);
        }
        stride *= static_cast<std::size_t>(radix);
        std::swap(from, beside);
      }
      return from;
    });
  }

private:
  /// Cosine of so many eighths of a number's share of the circle, at most half a circle: from an angle of at
  /// most pi / 4. Errors of the roots add up along a line, those of rounding a large angle by far the most.
  [[nodiscard]] double cosine(std::size_t eighths) const noexcept {
    const bool left = eighths > 2 * length_;
    if (left) eighths = 4 * length_ - eighths;
    const double unit = 0.25 * std::numbers::pi / static_cast<double>(length_);
    const double c = eighths <= length_ ? std::cos(unit * static_cast<double>(eighths))
                                        : std::sin(unit * static_cast<double>(2 * length_ - eighths));
    return left ? -c : c;
  }

  /// Splits each of `stride` interleaved transforms into P interleaved ones of a P-th of the length.
  template <int P>
  [[gnu::always_inline]] void stage(const double* from, double* to, std::size_t stride) const noexcept {
    const std::size_t count = length_ / (stride * P);  // length of the transforms that are left
    for (std::size_t q = 0; q < count; ++q) {
      double cosines[P], sines[P];
      each<P>([&](int j) CAIRN_INLINED {
        const std::complex<double>& root = roots_[q * static_cast<std::size_t>(j) * stride];
        cosines[j] = root.real();
        sines[j] = root.imag();
      });
      for (std::size_t k = 0; k < stride; ++k) {
        FftNumber a[P];
        each<P>([&](int j) CAIRN_INLINED {
          const std::size_t place = k + stride * (q + static_cast<std::size_t>(j) * count);
          a[j].load(from + fft_number * place);
        });
        short_transform(a);
        each<P>([&](int j) CAIRN_INLINED {
          if (j > 0 && q > 0)
            a[j] = {a[j].re * cosines[j] - a[j].im * sines[j], a[j].re * sines[j] + a[j].im * cosines[j]};
          a[j].store(to + fft_number * (k + stride * (q * P + static_cast<std::size_t>(j))));
        });
      }
    }
  }

  std::size_t length_;
  std::vector<std::complex<double>> roots_;  // of unity
  std::vector<int> radices_;
};

/// Rows become columns.
[[gnu::always_inline]] inline void transpose(FftLane (&a)[4]) noexcept {
  FftLane b[4];
  shuffle<0, 4, 2, 6>(a[0], a[1], b[0]);
  shuffle<1, 5, 3, 7>(a[0], a[1], b[1]);
  shuffle<0, 4, 2, 6>(a[2], a[3], b[2]);
  shuffle<1, 5, 3, 7>(a[2], a[3], b[3]);
  shuffle<0, 1, 4, 5>(b[0], b[2], a[0]);
  shuffle<0, 1, 4, 5>(b[1], b[3], a[1]);
  shuffle<2, 3, 6, 7>(b[0], b[2], a[2]);
  shuffle<2, 3, 6, 7>(b[1], b[3], a[3]);
}

/// The work of sliding_products(): there along the rows and down the columns, back the other way round.
class SlidingProducts {
public:
  SlidingProducts(const Plane& big, const Plane& small)
      : big_(big),
        small_(small),
        width_(size_of(fast_length(big.columns))),
        height_(size_of(fast_length(big.rows))),
        row_transform_(fast_length(big.columns)),
        column_transform_(fast_length(big.rows)),
        memory_(2 * fft_number * padded(std::max(width_, height_))),
        spectrum_(fft_number * padded(height_) * padded(width_) / fft_lines) {}

  [[nodiscard]] Plane operator()() {
    Plane result(big_.columns - small_.columns + 1, big_.rows - small_.rows + 1);
    with_avx2_lanes([&]() CAIRN_INLINED {
      transform_rows();
      transform_columns();
      multiply(size_of(result.rows));
      transform_rows_back(result);
    });
    return result;
  }

private:
  static std::size_t size_of(int n) noexcept { return static_cast<std::size_t>(n); }
  /// To whole blocks, of which what lies beyond the end is read and written, and of no use.
  static std::size_t padded(std::size_t n) noexcept { return (n + fft_number - 1) / fft_number * fft_number; }
  /// A plane of complex numbers lies in strips of four columns, each as the transform wants it.
  [[nodiscard]] double* strip(std::size_t column) noexcept {
    return spectrum_.data() + fft_number * padded(height_) * (column / fft_lines);
  }
  [[nodiscard]] double* beside() noexcept { return memory_.data() + memory_.size() / 2; }

  /// Rows r ... r + 3 of a plane become a part of four lines; what the plane lacks is zero.
  [[gnu::always_inline]] void fill(const Plane& plane, std::size_t r, double* part) {
    const std::size_t columns = size_of(plane.columns), rows = size_of(plane.rows);
    std::size_t c = 0;
    if (r + fft_lines <= rows)
      for (; c + fft_lines <= columns; c += fft_lines) {
        const double* from = &plane.values[r * columns + c];
        FftLane block[fft_lines];
        each<fft_lines>([&](int l) CAIRN_INLINED {
          std::memcpy(&block[l], from + size_of(l) * columns, sizeof(FftLane));
        });
        transpose(block);
        each<fft_lines>([&](int l) CAIRN_INLINED {
          std::memcpy(part + fft_number * (c + size_of(l)), &block[l], sizeof(FftLane));
        });
      }
    for (; c < width_; ++c)
      for (std::size_t l = 0; l < fft_lines; ++l)
        part[fft_number * c + l] = c < columns && r + l < rows ? plane.values[(r + l) * columns + c] : 0.0;
  }

  /// One transform serves both planes, as real and imaginary part.
  [[gnu::always_inline]] void transform_rows() {
    for (std::size_t r = 0; r < size_of(big_.rows); r += fft_lines) {
      fill(big_, r, memory_.data());
      fill(small_, r, memory_.data() + fft_lines);
      const double* lines = row_transform_.run(memory_.data(), beside());
      for (std::size_t c = 0; c < width_; c += fft_lines) {
        FftLane re[fft_lines], im[fft_lines];
        each<fft_lines>([&](int l) CAIRN_INLINED {
          FftNumber number;
          number.load(lines + fft_number * (c + size_of(l)));
          re[l] = number.re;
          im[l] = number.im;
        });
        transpose(re);
        transpose(im);
        double* to = strip(c) + fft_number * r;
        each<fft_lines>([&](int l) CAIRN_INLINED {
          const FftNumber number{re[l], im[l]};
          number.store(to + fft_number * size_of(l));
        });
      }
    }
  }

  [[gnu::always_inline]] void transform_columns() {
    for (std::size_t c = 0; c < width_; c += fft_lines) {
      std::fill(strip(c) + fft_number * size_of(big_.rows), strip(c) + fft_number * height_, 0.0);
      const double* result = column_transform_.run(strip(c), beside());
      if (result != strip(c)) std::copy_n(result, fft_number * height_, strip(c));
    }
  }

  /// The transform of the sums, and back down its columns. With Z = B + i S of real planes
  ///   B = (Z(k) + conj Z(-k)) / 2, S = (Z(k) - conj Z(-k)) / 2i,
  /// the product is B conj S. The sums are real, so columns beyond the middle mirror those before it.
  [[gnu::always_inline]] void multiply(std::size_t rows_wanted) {
    const double factor = 0.25 / static_cast<double>(width_ * height_);
    const std::size_t middle = width_ / 2;
    for (std::size_t c = 0; c <= middle; c += fft_lines) {
      const double* mirrored[fft_lines];
      for (std::size_t l = 0; l < fft_lines; ++l) {
        const std::size_t column = (width_ - std::min(c + l, middle)) % width_;
        mirrored[l] = strip(column) + column % fft_lines;
      }
      for (std::size_t r = 0; r < height_; ++r) {
        const std::size_t back = fft_number * (r == 0 ? 0 : height_ - r);
        FftNumber z;
        z.load(strip(c) + fft_number * r);
        const double* const* m = mirrored;
        const std::size_t im = back + fft_lines;
        const FftNumber mirror{{m[0][back], m[1][back], m[2][back], m[3][back]},
                               {-m[0][im], -m[1][im], -m[2][im], -m[3][im]}};
        const FftNumber sum{z.re + mirror.re, z.im + mirror.im};
        const FftNumber difference{z.re - mirror.re, z.im - mirror.im};
        const FftNumber swapped{factor * (sum.re * difference.re + sum.im * difference.im),
                                factor * (sum.re * difference.im - sum.im * difference.re)};
        swapped.store(memory_.data() + fft_number * r);
      }
      // No later strip mirrors this one. A row more than wanted, as two are transformed together.
      std::copy_n(column_transform_.run(memory_.data(), beside()),
                  fft_number * std::min(rows_wanted + 1, height_), strip(c));
    }
  }

  /// Two rows at a time, as real and imaginary part.
  [[gnu::always_inline]] void transform_rows_back(Plane& result) {
    const std::size_t columns = size_of(result.columns), rows = size_of(result.rows), middle = width_ / 2;
    for (std::size_t r = 0; r < rows; r += 2 * fft_lines) {
      for (std::size_t c = 0; c <= middle; c += fft_lines) {
        FftLane re[fft_lines], im[fft_lines], mirrored_re[fft_lines], mirrored_im[fft_lines];
        const double* from = strip(c) + fft_number * r;
        each<fft_lines>([&](int l) CAIRN_INLINED {
          FftNumber first, second;  // with the parts swapped
          first.load(from + fft_number * size_of(2 * l));
          second.load(from + fft_number * size_of(2 * l + 1));
          re[l] = first.im - second.re;
          im[l] = first.re + second.im;
          mirrored_re[l] = first.im + second.re;
          mirrored_im[l] = second.im - first.re;
        });
        transpose(re);
        transpose(im);
        transpose(mirrored_re);
        transpose(mirrored_im);
        each<fft_lines>([&](int l) CAIRN_INLINED {
          const std::size_t column = c + size_of(l);
          const FftNumber number{im[l], re[l]}, mirror{mirrored_im[l], mirrored_re[l]};
          if (column <= middle) number.store(memory_.data() + fft_number * column);
          if (column <= middle && column > 0 && 2 * column != width_)
            mirror.store(memory_.data() + fft_number * (width_ - column));
        });
      }
      const double* lines = row_transform_.run(memory_.data(), beside());
      for (std::size_t c = 0; c < columns; c += fft_lines)
        for (std::size_t part = 0; part < 2; ++part) {  // swapped: the imaginary part is the first row
          const double* from = lines + fft_number * c + (1 - part) * fft_lines;
          FftLane block[fft_lines];
          each<fft_lines>([&](int l) CAIRN_INLINED {
            std::memcpy(&block[l], from + fft_number * size_of(l), sizeof(FftLane));
          });
          transpose(block);
          for (std::size_t l = 0; l < fft_lines && r + 2 * l + part < rows; ++l) {
            double* to = &result.values[(r + 2 * l + part) * columns + c];
            if (c + fft_lines <= columns)
              std::memcpy(to, &block[l], sizeof(FftLane));
            else
              std::memcpy(to, &block[l], (columns - c) * sizeof(double));
          }
        }
    }
  }

  const Plane &big_, &small_;
  std::size_t width_, height_;
  LinesTransform row_transform_, column_transform_;
  std::vector<double> memory_;  // four lines, and four beside them
  std::vector<double> spectrum_;
};

/// result(s, t) = sum over (c, r) of big(s + c, t + r) small(c, r), for every shift at which the small plane
/// lies inside the big one: (big.columns - small.columns + 1) x (big.rows - small.rows + 1) sums. O(n log n).
[[nodiscard]] inline Plane sliding_products(const Plane& big, const Plane& small) {
  CAIRN_EXPECTS(
      small.columns >= 1 && small.rows >= 1 && small.columns <= big.columns && small.rows <= big.rows,
      "sliding_products needs a small plane that fits into the big one");
  return SlidingProducts(big, small)();
}

}}}  // namespace cairn::CAIRN_ABI::detail
