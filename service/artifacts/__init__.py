from service.artifacts.endpoints import router

__all__ = ["router"]
