// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <set>

#include "colmap_ext/database/two_view_geometry_backup.h"
#include "colmap_ext/host/database.h"
#include "colmap_ext/io/image_codecs.h"
#include "colmap_ext/report/report_examples.h"
#include "colmap_ext/report/report_html.h"

namespace adasfm {
namespace {

namespace fs = std::filesystem;

constexpr int kGapPx = 6;
// Width of a shown photo: wide enough to recognise a wrong match on a phone and
// on paper, at about 30 kB per photo.
constexpr int kPhotoWidthPx = 520;
constexpr int kJpegQuality = 70;
// Lines drawn for each of kept and dropped matches, evenly sampled.
constexpr size_t kMaxNumLines = 60;

struct Photo {
  cv::Mat pixels;      // at the shown size
  double scale = 1.0;  // shown pixels per pixel of the camera
  cv::Point corner;    // position in the joined picture
};

struct Lines {
  std::string css_class;
  std::vector<FeatureMatch> matches;
};

// OpenCV reports unreadable files to its log and, at any log level, to standard
// error; the report has its own message. For use in one thread.
class SilentOpenCv {
 public:
  SilentOpenCv()
      : level_(cv::utils::logging::setLogLevel(
            cv::utils::logging::LOG_LEVEL_SILENT)),
        buffer_(std::cerr.rdbuf(nullptr)) {}
  ~SilentOpenCv() {
    std::cerr.rdbuf(buffer_);
    cv::utils::logging::setLogLevel(level_);
  }

 private:
  cv::utils::logging::LogLevel level_;
  std::streambuf* buffer_;
};

// JPEG decoders skip most of the work for a smaller picture.
int ReadFlags(double shrink) {
  // Keypoints refer to the stored pixels, before any rotation by EXIF.
  const int flags = cv::IMREAD_IGNORE_ORIENTATION;
  if (shrink >= 16.0) return flags | cv::IMREAD_REDUCED_COLOR_8;
  if (shrink >= 8.0) return flags | cv::IMREAD_REDUCED_COLOR_4;
  if (shrink >= 4.0) return flags | cv::IMREAD_REDUCED_COLOR_2;
  return flags | cv::IMREAD_COLOR;
}

std::optional<Photo> ReadPhoto(const std::string& path,
                               const colmap::Camera& camera, int width_px) {
  std::error_code error;
  if (!fs::is_regular_file(path, error) || WidthOf(camera) == 0) {
    return std::nullopt;
  }
  const SilentOpenCv silent;
  Photo photo;
  try {
    const cv::Mat pixels =
        ReadImageFile(path, ReadFlags(WidthOf(camera) / width_px));
    if (pixels.empty()) return std::nullopt;
    const double height_px =
        static_cast<double>(width_px) * pixels.rows / pixels.cols;
    cv::resize(pixels, photo.pixels,
               cv::Size(width_px, std::max(1, cvRound(height_px))), 0.0, 0.0,
               cv::INTER_AREA);
  } catch (const cv::Exception&) {
    return std::nullopt;
  }
  photo.scale = width_px / WidthOf(camera);
  return photo;
}

// Places wide photos one above the other and tall ones side by side, so that
// both fit a phone.
cv::Mat Join(Photo* photo1, Photo* photo2) {
  const cv::Size size1 = photo1->pixels.size(), size2 = photo2->pixels.size();
  const bool is_wide = size1.width >= size1.height;
  photo2->corner = is_wide ? cv::Point(0, size1.height + kGapPx)
                           : cv::Point(size1.width + kGapPx, 0);
  const cv::Size size(std::max(size1.width, photo2->corner.x + size2.width),
                      std::max(size1.height, photo2->corner.y + size2.height));
  cv::Mat joined(size, CV_8UC3, cv::Scalar::all(128));
  photo1->pixels.copyTo(joined(cv::Rect(photo1->corner, size1)));
  photo2->pixels.copyTo(joined(cv::Rect(photo2->corner, size2)));
  return joined;
}

std::string FormatPoint(const Photo& photo, const Eigen::Vector2d& pixel) {
  return FormatNumber("%.0f", photo.corner.x + photo.scale * pixel.x()) + " " +
         FormatNumber("%.0f", photo.corner.y + photo.scale * pixel.y());
}

// One SVG path of evenly sampled matches.
std::string FormatLines(const Lines& lines, const Photo& photo1,
                        const Photo& photo2,
                        const std::vector<Eigen::Vector2d>& points1,
                        const std::vector<Eigen::Vector2d>& points2) {
  const size_t count = std::min(kMaxNumLines, lines.matches.size());
  std::string path;
  for (size_t i = 0; i < count; ++i) {
    const FeatureMatch& match = lines.matches[i * lines.matches.size() / count];
    if (match.point2D_idx1 >= points1.size() ||
        match.point2D_idx2 >= points2.size()) {
      continue;
    }
    path += "M" + FormatPoint(photo1, points1[match.point2D_idx1]) + "L" +
            FormatPoint(photo2, points2[match.point2D_idx2]);
  }
  if (path.empty()) return "";
  return "<path class=\"" + lines.css_class + "\" d=\"" + path + "\"/>";
}

// Lines to draw over the photos, and the caption that explains them.
std::vector<Lines> ReadLines(const ReportPair& pair, const ImagePair& ids,
                             SqliteConnection* database, std::string* caption) {
  if (pair.num_after == 0) {
    *caption = FormatCount(pair.num_before) + " inliers, all removed";
    return {{"dropped",
             ReadMatchesOfPair(database, kTwoViewGeometryBackupTable, ids)}};
  }
  Lines kept{"kept", ReadMatchesOfPair(database, "two_view_geometries", ids)};
  Lines dropped{"dropped", {}};
  const std::set<FeatureMatch> inliers(kept.matches.begin(),
                                       kept.matches.end());
  for (const FeatureMatch& match :
       ReadMatchesOfPair(database, "matches", ids)) {
    if (inliers.count(match) == 0) dropped.matches.push_back(match);
  }
  *caption = FormatCount(kept.matches.size()) + " inliers, " +
             FormatCount(dropped.matches.size()) + " raw matches dropped";
  return {std::move(dropped), std::move(kept)};
}

std::string FormatFigure(const cv::Mat& picture, const std::string& title,
                         const std::string& caption, const std::string& lines) {
  const std::vector<unsigned char> jpeg =
      EncodeImage(".jpg", picture, {cv::IMWRITE_JPEG_QUALITY, kJpegQuality});
  const std::string width = std::to_string(picture.cols);
  const std::string height = std::to_string(picture.rows);
  return "<figure class=\"example\"><figcaption><b>" + EscapeHtml(title) +
         "</b><br>" + EscapeHtml(caption) +
         "</figcaption><svg role=\"img\" aria-label=\"" + EscapeHtml(title) +
         "\" viewBox=\"0 0 " + width + " " + height + "\"><image width=\"" +
         width + "\" height=\"" + height + "\" href=\"data:image/jpeg;base64," +
         EncodeBase64(jpeg.data(), jpeg.size()) + "\"/>" + lines +
         "</svg></figure>\n";
}

// Reads the data of a figure from the database and the photos.
class ExampleReader {
 public:
  ExampleReader(const ReportScene& scene, const std::string& image_path,
                SqliteConnection* database)
      : scene_(scene),
        image_path_(image_path),
        database_(database),
        cameras_(ReadCameras(database)) {
    for (const DatabaseImage& image : ReadImages(database)) {
      camera_ids_[image.image_id] = image.camera_id;
    }
  }

  // None when a photo cannot be read.
  std::optional<std::string> FormatExample(const ReportPair& pair) const {
    const ReportImage* image1 = &scene_.images[pair.index1];
    const ReportImage* image2 = &scene_.images[pair.index2];
    // In matches, the keypoint of the image with the lower id comes first.
    if (image2->image_id < image1->image_id) std::swap(image1, image2);
    std::optional<Photo> photo1 = ReadPhotoOf(*image1);
    std::optional<Photo> photo2 = ReadPhotoOf(*image2);
    if (!photo1 || !photo2) return std::nullopt;
    const ImagePair ids(image1->image_id, image2->image_id);
    const cv::Mat picture = Join(&*photo1, &*photo2);
    const std::vector<Eigen::Vector2d> points1 =
        ReadKeypointsOfImage(database_, ids.image_id1);
    const std::vector<Eigen::Vector2d> points2 =
        ReadKeypointsOfImage(database_, ids.image_id2);
    std::string caption, drawn;
    for (const Lines& lines : ReadLines(pair, ids, database_, &caption)) {
      drawn += FormatLines(lines, *photo1, *photo2, points1, points2);
    }
    return FormatFigure(picture, image1->name + " – " + image2->name, caption,
                        drawn);
  }

 private:
  std::optional<Photo> ReadPhotoOf(const ReportImage& image) const {
    const auto camera_id = camera_ids_.find(image.image_id);
    if (camera_id == camera_ids_.end()) return std::nullopt;
    const auto camera = cameras_.find(camera_id->second);
    if (camera == cameras_.end()) return std::nullopt;
    // Two tall photos share the width.
    const bool is_tall = HeightOf(camera->second) > WidthOf(camera->second);
    return ReadPhoto((fs::path(image_path_) / image.name).string(),
                     camera->second,
                     is_tall ? kPhotoWidthPx / 2 : kPhotoWidthPx);
  }

  const ReportScene& scene_;
  const std::string& image_path_;
  SqliteConnection* database_;
  std::map<camera_t, colmap::Camera> cameras_;
  std::map<image_t, camera_t> camera_ids_;
};

}  // namespace

std::string FormatExamples(const std::vector<ReportPair>& pairs,
                           const ReportScene& scene,
                           const std::string& image_path,
                           SqliteConnection* database, int* num_unreadable) {
  *num_unreadable = 0;
  const ExampleReader reader(scene, image_path, database);
  std::string html;
  for (const ReportPair& pair : pairs) {
    const std::optional<std::string> figure = reader.FormatExample(pair);
    if (figure) {
      html += *figure;
    } else {
      ++*num_unreadable;
    }
  }
  return html;
}

}  // namespace adasfm
