// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/paint_textures.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace adasfm {
namespace {

cv::Scalar Gray(double value) { return cv::Scalar(value, value, value); }

// A colour of a brightness between low and high, with a tint as paint and stone
// have it.
cv::Scalar RandomColor(double low, double high, Random* random) {
  const double brightness = random->Uniform(low, high);
  const double warmth = random->Uniform(-12.0, 25.0);
  const double green = random->Uniform(-8.0, 8.0);
  return cv::Scalar(brightness - warmth, brightness + green,
                    brightness + warmth);
}

// Adds noise of one grain size to all channels.
void AddNoise(double grain_px, double amplitude, Random* random,
              cv::Mat* picture) {
  const cv::Size size(
      std::max(2, static_cast<int>(std::lround(picture->cols / grain_px))),
      std::max(2, static_cast<int>(std::lround(picture->rows / grain_px))));
  cv::Mat grains(size, CV_32F);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      grains.at<float>(y, x) =
          static_cast<float>(random->Uniform(-amplitude, amplitude));
    }
  }
  cv::Mat noise;
  cv::resize(grains, noise, picture->size(), 0.0, 0.0, cv::INTER_CUBIC);
  cv::Mat channels;
  cv::merge(std::vector<cv::Mat>(3, noise), channels);
  cv::add(*picture, channels, *picture, cv::noArray(), CV_8UC3);
}

void AddRoughness(double amplitude, Random* random, cv::Mat* picture) {
  for (const double grain_px : {3.0, 8.0, 24.0, 70.0}) {
    AddNoise(grain_px, amplitude, random, picture);
  }
}

// Spots, scratches and patches of all sizes.
void AddStains(int num, double max_size_px, Random* random, cv::Mat* picture) {
  for (int i = 0; i < num; ++i) {
    const cv::Point center(
        static_cast<int>(random->UniformInt(0, picture->cols - 1)),
        static_cast<int>(random->UniformInt(0, picture->rows - 1)));
    // Small ones are frequent.
    const double share = random->Uniform(0.0, 1.0);
    const double size = 1.5 + max_size_px * share * share * share;
    const cv::Size axes(
        static_cast<int>(std::ceil(size)),
        static_cast<int>(std::ceil(size * random->Uniform(0.3, 1.0))));
    cv::ellipse(*picture, center, axes, random->Uniform(0.0, 180.0), 0.0, 360.0,
                RandomColor(20.0, 230.0, random), cv::FILLED, cv::LINE_AA);
  }
}

class FacadePainter {
 public:
  FacadePainter(double px_per_m, Random* random, cv::Mat* picture)
      : px_per_m_(px_per_m), random_(random), picture_(picture) {}

  // One house between two columns.
  void PaintHouse(int begin, int end) {
    cv::Mat house = picture_->colRange(begin, end);
    house.setTo(RandomColor(90.0, 190.0, random_));
    if (random_->Uniform(0.0, 1.0) < 0.5) PaintBricks(&house);
    AddRoughness(12.0, random_, &house);
    const double floor = px_per_m_ * random_->Uniform(2.7, 3.3);
    for (double base = 0.0; base + floor < house.rows; base += floor) {
      PaintFloor(base, floor, base == 0.0, &house);
    }
    const double square_metres =
        house.cols * house.rows / (px_per_m_ * px_per_m_);
    AddStains(static_cast<int>(4.0 * square_metres), 0.25 * px_per_m_, random_,
              &house);
    // The joint between the houses.
    cv::line(house, {0, 0}, {0, house.rows - 1}, Gray(50.0), 2);
  }

 private:
  int Px(double metres) const {
    return static_cast<int>(std::lround(metres * px_per_m_));
  }

  void PaintBricks(cv::Mat* house) {
    const int height = std::max(3, Px(0.12));
    const int width = std::max(6, Px(0.3));
    for (int y = 0, row = 0; y < house->rows; y += height, ++row) {
      for (int x = row % 2 == 0 ? 0 : -width / 2; x < house->cols; x += width) {
        const cv::Rect brick = cv::Rect(x, y, width - 1, height - 1) &
                               cv::Rect(0, 0, house->cols, house->rows);
        if (brick.area() == 0) continue;
        const cv::Mat part = (*house)(brick);
        cv::add(part, Gray(random_->Uniform(-25.0, 25.0)), part);
      }
    }
  }

  void PaintFloor(double base, double floor, bool is_ground, cv::Mat* house) {
    double x = px_per_m_ * random_->Uniform(0.4, 1.0);
    while (true) {
      const double width = px_per_m_ * random_->Uniform(0.8, 1.7);
      if (x + width + 0.3 * px_per_m_ > house->cols) return;
      const bool is_door = is_ground && random_->Uniform(0.0, 1.0) < 0.3;
      const double sill = is_door ? 0.0 : floor * random_->Uniform(0.25, 0.38);
      const double height =
          floor * random_->Uniform(0.42, 0.52) + (is_door ? 0.2 * floor : 0.0);
      PaintOpening(cv::Rect(static_cast<int>(x), static_cast<int>(base + sill),
                            static_cast<int>(width), static_cast<int>(height)),
                   house);
      if (random_->Uniform(0.0, 1.0) < (is_ground ? 0.6 : 0.2)) {
        PaintSign(
            cv::Rect(static_cast<int>(x),
                     static_cast<int>(base + sill + height) + 3,
                     static_cast<int>(width), static_cast<int>(0.16 * floor)),
            house);
      }
      x += width + px_per_m_ * random_->Uniform(0.4, 1.3);
    }
  }

  // A window or door: frame, glass with what stands behind it, bars.
  void PaintOpening(const cv::Rect& area, cv::Mat* house) {
    const cv::Rect inside = area & cv::Rect(0, 0, house->cols, house->rows);
    if (inside.width < 8 || inside.height < 8) return;
    cv::Mat opening = (*house)(inside);
    opening.setTo(RandomColor(150.0, 250.0, random_));
    const int frame = std::max(2, Px(0.07));
    cv::Mat glass = opening(cv::Rect(frame, frame, opening.cols - 2 * frame,
                                     opening.rows - 2 * frame));
    glass.setTo(RandomColor(15.0, 90.0, random_));
    for (int i = 0; i < 3; ++i) {
      const int x = static_cast<int>(random_->UniformInt(0, glass.cols - 1));
      const int y = static_cast<int>(random_->UniformInt(0, glass.rows - 1));
      const int width =
          static_cast<int>(random_->UniformInt(2, 2 + glass.cols / 2));
      const int height =
          static_cast<int>(random_->UniformInt(2, 2 + glass.rows / 2));
      cv::rectangle(glass, cv::Rect(x, y, width, height),
                    RandomColor(10.0, 220.0, random_), cv::FILLED);
    }
    AddNoise(12.0, 15.0, random_, &glass);
    const int bar = static_cast<int>(
        random_->UniformInt(glass.cols / 4, 3 * glass.cols / 4));
    cv::line(glass, {bar, 0}, {bar, glass.rows - 1}, Gray(200.0),
             std::max(1, frame / 2));
  }

  // Letter-like strokes on a bright or dark board.
  void PaintSign(const cv::Rect& area, cv::Mat* house) {
    const cv::Rect inside = area & cv::Rect(0, 0, house->cols, house->rows);
    if (inside.width < 8 || inside.height < 6) return;
    cv::Mat sign = (*house)(inside);
    const bool is_bright = random_->Uniform(0.0, 1.0) < 0.5;
    sign.setTo(is_bright ? RandomColor(180.0, 250.0, random_)
                         : RandomColor(10.0, 80.0, random_));
    const cv::Scalar ink = is_bright ? RandomColor(0.0, 80.0, random_)
                                     : RandomColor(180.0, 255.0, random_);
    const int letter = std::max(3, sign.rows / 2);
    for (int x = 3; x + letter < sign.cols; x += letter + 2) {
      for (int stroke = 0; stroke < 3; ++stroke) {
        const auto point = [&]() {
          const int px = x + static_cast<int>(random_->UniformInt(0, letter));
          return cv::Point(
              px, static_cast<int>(random_->UniformInt(2, sign.rows - 3)));
        };
        const cv::Point from = point();
        cv::line(sign, from, point(), ink, std::max(1, sign.rows / 9),
                 cv::LINE_AA);
      }
    }
  }

  double px_per_m_;
  Random* random_;
  cv::Mat* picture_;
};

}  // namespace

FacadePicture PaintFacade(double width_m, double height_m, double px_per_m,
                          Random* random) {
  FacadePicture facade;
  facade.picture.create(static_cast<int>(std::lround(height_m * px_per_m)),
                        static_cast<int>(std::lround(width_m * px_per_m)),
                        CV_8UC3);
  facade.height_m.assign(facade.picture.cols, height_m);
  FacadePainter painter(px_per_m, random, &facade.picture);
  int begin = 0;
  while (begin < facade.picture.cols) {
    int end = begin + static_cast<int>(
                          std::lround(px_per_m * random->Uniform(7.0, 13.0)));
    // No slivers at the end of the row.
    if (end + 4.0 * px_per_m > facade.picture.cols) end = facade.picture.cols;
    painter.PaintHouse(begin, end);
    std::fill(facade.height_m.begin() + begin, facade.height_m.begin() + end,
              height_m * random->Uniform(0.75, 1.0));
    begin = end;
  }
  return facade;
}

cv::Mat PaintRoad(double length_m, double width_m, double px_per_m,
                  Random* random) {
  cv::Mat road(static_cast<int>(std::lround(width_m * px_per_m)),
               static_cast<int>(std::lround(length_m * px_per_m)), CV_8UC3);
  road.setTo(Gray(random->Uniform(85.0, 120.0)));
  AddRoughness(10.0, random, &road);
  AddStains(static_cast<int>(1.5 * length_m * width_m), 0.4 * px_per_m, random,
            &road);
  const int num_cracks = static_cast<int>(length_m);
  for (int i = 0; i < num_cracks; ++i) {
    cv::Point from(static_cast<int>(random->UniformInt(0, road.cols - 1)),
                   static_cast<int>(random->UniformInt(0, road.rows - 1)));
    for (int k = 0; k < 5; ++k) {
      const int reach = static_cast<int>(px_per_m);
      const int dx = static_cast<int>(random->UniformInt(-reach, reach));
      const cv::Point to(
          from.x + dx,
          from.y + static_cast<int>(random->UniformInt(-reach, reach)));
      cv::line(road, from, to, Gray(45.0), 1, cv::LINE_AA);
      from = to;
    }
  }
  return road;
}

}  // namespace adasfm
