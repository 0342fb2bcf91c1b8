from service.health.endpoints import router

__all__ = ["router"]
