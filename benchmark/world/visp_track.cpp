// Follows an object in image files by ViSP's model-based tracker, as a peer to compare with (see visp.py).
//
// visp_track MODEL.cao TYPE POSES.txt CAMERA...   with CAMERA: CONFIG.xml T_cam_first.txt FOLDER
//
// TYPE: 1 edges, 2 KLT, 3 both. FOLDER holds 000.png, 001.png ... of one camera. The first line of POSES.txt is the start, the
// pose of the object in the first camera as 16 numbers; a line is written for every image: milliseconds, and the pose or "lost".
#include <chrono>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <map>
#include <string>
#include <vector>
#include <visp3/io/vpImageIo.h>
#include <visp3/mbt/vpMbGenericTracker.h>

static vpHomogeneousMatrix read_pose(std::istream &in) {
  vpHomogeneousMatrix T;
  for (unsigned i = 0; i < 4; i++)
    for (unsigned j = 0; j < 4; j++)
      in >> T[i][j];
  return T;
}

int main(int argc, char **argv) {
  if (argc < 7 || (argc - 4) % 3 != 0) {
    std::cerr << "usage: visp_track MODEL.cao TYPE POSES.txt CONFIG.xml T_cam_first.txt FOLDER ...\n";
    return 2;
  }
  try {
    const int n = (argc - 4) / 3;
    std::vector<std::string> names;
    std::map<std::string, std::string> configs, models;
    std::map<std::string, vpHomogeneousMatrix> places, poses;
    for (int i = 0; i < n; i++) {
      names.push_back("Camera" + std::to_string(i + 1));
      configs[names[i]] = argv[4 + 3 * i];
      models[names[i]] = argv[1];
      std::ifstream file(argv[5 + 3 * i]);
      places[names[i]] = read_pose(file);
    }
    vpMbGenericTracker tracker(names, std::vector<int>(n, std::atoi(argv[2])));
    tracker.loadConfigFile(configs, false);
    tracker.loadModel(models, false);
    tracker.setCameraTransformationMatrix(places);
    std::ifstream start(argv[3]);
    vpHomogeneousMatrix pose = read_pose(start);
    start.close();
    std::ofstream out(argv[3]);
    out.precision(12);
    for (int number = 0;; number++) {
      std::map<std::string, vpImage<unsigned char> > images;
      std::map<std::string, const vpImage<unsigned char> *> pointers;
      char file[16];
      std::snprintf(file, sizeof file, "/%03d.png", number);
      if (!std::ifstream(argv[6] + std::string(file)).good())
        break;
      for (int i = 0; i < n; i++) {
        vpImageIo::read(images[names[i]], argv[6 + 3 * i] + std::string(file));
        pointers[names[i]] = &images[names[i]];
      }
      bool lost = false;
      const auto began = std::chrono::steady_clock::now();
      try {
        if (number == 0) {
          for (int i = 0; i < n; i++)
            poses[names[i]] = places[names[i]] * pose;
          tracker.initFromPose(pointers, poses);
        }
        tracker.track(pointers);
        tracker.getPose(pose);
      } catch (const vpException &) {
        lost = true;
      }
      out << std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - began).count();
      if (lost)
        out << " lost";
      else
        for (unsigned i = 0; i < 16; i++)
          out << ' ' << pose[i / 4][i % 4];
      out << '\n';
    }
  } catch (const vpException &error) {
    std::cerr << error.what() << '\n';
    return 1;
  }
  return 0;
}
