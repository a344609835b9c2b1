// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <map>
#include <opencv2/core.hpp>
#include <tuple>
#include <vector>

#include "synthetic/mip_texture.h"
#include "synthetic/street_grid.h"
#include "synthetic/synthetic_world.h"

namespace adasfm {

// Renders photos of a world: one ray per pixel is intersected with facades,
// ground and sky; textures are averaged over the pixel's footprint; lens blur
// and sensor noise are added. With an exposure time the photo is the mean over
// evenly spaced moments while the shutter is open. The gain scales the grey
// levels, which are clipped at white. Images without keypoints (blackouts) are
// uniformly grey. Streets that look alike have the same textures. Pixel (x, y)
// of the picture has its centre at (x + 0.5, y + 0.5) in the camera's pixels,
// as in COLMAP.
class WorldRenderer {
 public:
  // The world must outlive the renderer.
  explicit WorldRenderer(const SyntheticWorld& world);

  // CV_8UC3 in OpenCV's order, blue first. Textures are painted when they are
  // first seen, and kept.
  cv::Mat Render(size_t image_index);

 private:
  struct Facade {
    MipTexture texture;
    std::vector<double> height_m;
  };
  struct PixelRay {
    Eigen::Vector3d direction;
    double angle_rad;  // covered by the pixel
  };

  const Street& StreetBetween(const GridNode& a, const GridNode& b);
  const Facade& FacadeOf(const Street& street, int side);
  const MipTexture& RoadOf(const Street& street);
  const MipTexture& CrossingOf(const GridNode& node);

  Eigen::Vector3f Shade(const Eigen::Vector3d& center, const PixelRay& ray);
  // False when the ray hits no facade, e.g. above the houses.
  bool ShadeWall(const Eigen::Vector3d& center, const PixelRay& ray,
                 double* distance, Eigen::Vector3f* color);
  Eigen::Vector3f ShadeGround(const Eigen::Vector3d& center,
                              const PixelRay& ray);
  // Fills rays_in_cam_ for a focal length.
  void AimRays(double focal_factor);
  // Unclipped grey levels (CV_32FC3): at one pose, and of an image.
  cv::Mat RenderLight(const Rigid3d& cam_from_world);
  cv::Mat CollectLight(const SyntheticImage& image);
  void AddLensAndNoise(size_t image_index, cv::Mat* picture) const;

  const SyntheticWorld& world_;
  StreetGrid grid_;
  double rays_focal_factor_ = 0.0;
  std::vector<PixelRay> rays_in_cam_;
  std::map<StreetId, Street> far_streets_;
  std::map<std::tuple<uint64_t, int>, Facade> facades_;
  std::map<uint64_t, MipTexture> roads_;
  std::map<GridNode, MipTexture> crossings_;
};

}  // namespace adasfm
